//! An accessor's elements as numbers: of every component type, normalised or not, sparse or not.

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked::Valid;
use gltf::json::{Accessor, Index, buffer};

use super::storage::Storage;
use crate::error::ImportProblem;

/// Rows of numbers.
pub(super) struct Values {
    /// Numbers to each element.
    pub width: usize,
    /// The elements, one after another.
    pub numbers: Vec<f32>,
}

impl Values {
    /// The elements.
    pub(super) fn rows(&self) -> std::slice::ChunksExact<'_, f32> {
        self.numbers.chunks_exact(self.width)
    }

    /// Number of elements.
    pub(super) fn len(&self) -> usize {
        self.numbers.len() / self.width
    }
}

/// Reads an accessor whole. `what` names it in messages.
pub(super) fn read(
    storage: &mut Storage,
    index: Index<Accessor>,
    what: &dyn Fn() -> String,
) -> Result<Values, ImportProblem> {
    let unreadable = || ImportProblem::Undecodable {
        place: what(),
        detail: format!(
            "accessor {index} is not in the file, reaches outside its buffer, or has none and more elements than the file has bytes"
        ),
    };
    let accessor = storage.root.get(index).ok_or_else(unreadable)?.clone();
    let (Valid(component), Valid(shape)) = (accessor.component_type, accessor.type_) else {
        return Err(unreadable());
    };
    let width = match shape {
        Type::Scalar => 1,
        Type::Vec2 => 2,
        Type::Vec3 => 3,
        Type::Vec4 | Type::Mat2 => 4,
        Type::Mat3 => 9,
        Type::Mat4 => 16,
    };
    let count = usize::try_from(accessor.count.0).map_err(|_| unreadable())?;
    storage.charge(count.checked_mul(width * 4))?;
    let read = Reader { storage, component: component.0, width, normalized: accessor.normalized };
    read.accessor(&accessor, count).map(|numbers| Values { width, numbers }).ok_or_else(unreadable)
}

struct Reader<'a> {
    storage: &'a Storage<'a>,
    component: ComponentType,
    width: usize,
    normalized: bool,
}

impl Reader<'_> {
    fn accessor(&self, accessor: &Accessor, count: usize) -> Option<Vec<f32>> {
        let mut numbers = match accessor.buffer_view {
            Some(view) => self.rows(view, accessor.byte_offset.map_or(0, |offset| offset.0), count)?,
            None if count as u64 <= self.storage.most_zeros() => vec![0.0; count * self.width],
            None => return None,
        };
        let Some(sparse) = &accessor.sparse else { return Some(numbers) };
        let replaced = usize::try_from(sparse.count.0).ok().filter(|&replaced| replaced <= count)?;
        let Valid(component) = sparse.indices.component_type else { return None };
        let indices = Reader { component: component.0, width: 1, normalized: false, ..*self };
        let size = component.0.size();
        let bytes =
            indices.elements(sparse.indices.buffer_view, sparse.indices.byte_offset.0, replaced, size)?;
        let places: Vec<usize> = bytes.map(index).collect();
        let values = self.rows(sparse.values.buffer_view, sparse.values.byte_offset.0, replaced)?;
        for (&place, row) in places.iter().zip(values.chunks_exact(self.width)) {
            numbers.get_mut(place * self.width..)?.get_mut(..self.width)?.copy_from_slice(row);
        }
        Some(numbers)
    }

    fn rows(&self, view: Index<buffer::View>, offset: u64, count: usize) -> Option<Vec<f32>> {
        let size = self.component.size();
        let elements = self.elements(view, offset, count, size * self.width)?;
        let number = |bytes| number(bytes, self.component, self.normalized);
        Some(elements.flat_map(|element| element.chunks_exact(size)).map(number).collect())
    }

    /// The bytes of `count` elements of `size` bytes each.
    fn elements(
        &self,
        view: Index<buffer::View>,
        offset: u64,
        count: usize,
        size: usize,
    ) -> Option<impl Iterator<Item = &[u8]>> {
        let view = self.storage.root.get(view)?;
        let stride = view.byte_stride.map_or(size, |stride| stride.0);
        let bytes = self.storage.view(view)?.get(usize::try_from(offset).ok()?..)?;
        let end = match count {
            0 => 0,
            _ => (count - 1).checked_mul(stride)?.checked_add(size)?,
        };
        let holds = stride >= size && end <= bytes.len();
        holds.then(|| (0..count).map(move |i| &bytes[i * stride..][..size]))
    }
}

/// An unsigned integer of one, two or four bytes.
fn index(bytes: &[u8]) -> usize {
    bytes.iter().rev().fold(0, |value, &byte| value << 8 | usize::from(byte))
}

/// One component; normalised integers as KHR_mesh_quantization and glTF 2.0, section 3.6.2.2, define them.
fn number(bytes: &[u8], component: ComponentType, normalized: bool) -> f32 {
    let scaled = |value: f32, largest: f32| if normalized { (value / largest).max(-1.0) } else { value };
    match (component, bytes) {
        (ComponentType::I8, &[a]) => scaled(f32::from(a as i8), 127.0),
        (ComponentType::U8, &[a]) => scaled(f32::from(a), 255.0),
        (ComponentType::I16, &[a, b]) => scaled(f32::from(i16::from_le_bytes([a, b])), 32_767.0),
        (ComponentType::U16, &[a, b]) => scaled(f32::from(u16::from_le_bytes([a, b])), 65_535.0),
        (ComponentType::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]) as f32,
        (ComponentType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        _ => f32::NAN,
    }
}
