//! Accessors without data: all zeros, by the specification. The crate asks each for a buffer view, and compressors leave some that
//! nothing uses.

use gltf::json::accessor::Type;
use gltf::json::buffer::View;
use gltf::json::validation::Checked::Valid;

use super::storage::Storage;
use crate::error::ImportProblem;

/// Gives each such accessor a view of zeros. They have the same bytes, as many as the longest needs.
pub(super) fn fill(storage: &mut Storage) -> Result<(), ImportProblem> {
    let most = storage.most_zeros();
    let mut empty = vec![];
    let mut longest = 0;
    for (index, accessor) in storage.root.accessors.iter().enumerate() {
        let (Valid(component), Valid(shape)) = (accessor.component_type, accessor.type_) else { continue };
        if accessor.buffer_view.is_some() || accessor.sparse.is_some() || accessor.count.0 == 0 {
            continue;
        }
        let bytes = usize::try_from(accessor.count.0)
            .ok()
            .and_then(|count| count.checked_mul(components_of(shape) * component.0.size()));
        let Some(bytes) = bytes.filter(|bytes| *bytes as u64 <= most) else {
            return Err(ImportProblem::Undecodable {
                place: format!("accessor {index}"),
                detail: "it has no data, and claims more than the rest of the file has".to_owned(),
            });
        };
        longest = longest.max(bytes);
        empty.push((index, bytes));
    }
    if empty.is_empty() {
        return Ok(());
    }
    storage.charge(Some(longest))?;
    let zeros = storage.store(&vec![0; longest], None, None);
    for (index, bytes) in empty {
        // Vertex attributes may share a view only where it has a stride.
        let view = storage.root.push(View { byte_length: bytes.into(), ..zeros.clone() });
        let accessor = &mut storage.root.accessors[index];
        (accessor.buffer_view, accessor.byte_offset) = (Some(view), None);
    }
    Ok(())
}

/// Components of an element, the padding of matrices included.
fn components_of(shape: Type) -> usize {
    match shape {
        Type::Scalar => 1,
        Type::Vec2 => 2,
        Type::Vec3 => 3,
        Type::Vec4 => 4,
        Type::Mat2 => 8,
        Type::Mat3 => 12,
        Type::Mat4 => 16,
    }
}
