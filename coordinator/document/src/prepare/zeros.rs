//! Accessors without data: all zeros, by the specification. The crate asks each for a buffer view, and compressors leave some that
//! nothing uses.

use gltf::json::Index;
use gltf::json::accessor::Type;
use gltf::json::validation::Checked::Valid;

use super::storage::Storage;
use crate::error::ImportProblem;

/// Gives such accessors one view of zeros, as long as the longest needs it.
pub(super) fn fill(storage: &mut Storage) -> Result<(), ImportProblem> {
    let most = storage.most_zeros();
    let mut empty = vec![];
    let mut longest = 0;
    for (index, accessor) in storage.root.accessors.iter().enumerate() {
        let (Valid(component), Valid(shape)) = (accessor.component_type, accessor.type_) else { continue };
        if accessor.buffer_view.is_some() || accessor.sparse.is_some() {
            continue;
        }
        if accessor.count.0 > most {
            return Err(ImportProblem::Undecodable {
                place: format!("accessor {index}"),
                detail: "it has no data, and more elements than the file has bytes".to_owned(),
            });
        }
        longest = longest.max(accessor.count.0 as usize * components_of(shape) * component.0.size());
        empty.push(index);
    }
    if empty.is_empty() {
        return Ok(());
    }
    storage.charge(Some(longest))?;
    let view = storage.store(&vec![0; longest], None, None);
    let view: Index<_> = storage.root.push(view);
    for index in empty {
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
