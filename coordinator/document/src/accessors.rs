//! Checks an accessor before it is read: the crate's readers trust counts, strides, formats and offsets.

use gltf::accessor::{DataType, Dimensions};
use gltf::{Accessor, buffer};

use super::error::ImportProblem;

/// Formats that an attribute may have.
pub struct Format {
    data_types: &'static [DataType],
    dimensions: &'static [Dimensions],
    words: &'static str,
}

/// POSITION and NORMAL.
pub const VECTOR: Format =
    Format { data_types: &[DataType::F32], dimensions: &[Dimensions::Vec3], words: "VEC3 of floats" };

/// TEXCOORD_n.
pub const TEXTURE_COORDINATES: Format = Format {
    data_types: &[DataType::F32, DataType::U8, DataType::U16],
    dimensions: &[Dimensions::Vec2],
    words: "VEC2 of floats, unsigned bytes or unsigned shorts",
};

/// COLOR_n.
pub const COLOUR: Format = Format {
    data_types: &[DataType::F32, DataType::U8, DataType::U16],
    dimensions: &[Dimensions::Vec3, Dimensions::Vec4],
    words: "VEC3 or VEC4 of floats, unsigned bytes or unsigned shorts",
};

/// _COLOR_0.
pub const TINT: Format = Format {
    data_types: &[DataType::F32],
    dimensions: &[Dimensions::Vec3, Dimensions::Vec4],
    words: "VEC3 or VEC4 of floats",
};

/// Vertex indices.
pub const INDICES: Format = Format {
    data_types: &[DataType::U8, DataType::U16, DataType::U32],
    dimensions: &[Dimensions::Scalar],
    words: "SCALAR of unsigned integers",
};

/// Context of an accessor that is checked.
pub struct Context<'a> {
    /// Node and primitive, for messages.
    pub place: &'a str,
    /// The bytes of every buffer.
    pub buffers: &'a [Vec<u8>],
}

/// Most elements of an accessor without data, a sparse one over zeros. Each belongs to a vertex with at least a byte of data elsewhere;
/// without a bound, a short file could claim memory for millions.
pub(crate) fn most_zeros(buffers: &[Vec<u8>]) -> u64 {
    buffers.iter().map(|bytes| bytes.len() as u64).sum()
}

/// Checks that `accessor` has one of the formats, at least one element, and all its bytes within its buffers.
pub fn check(
    accessor: &Accessor,
    attribute: &str,
    format: &Format,
    context: &Context,
) -> Result<(), ImportProblem> {
    let place = context.place.to_owned();
    let (attribute, index) = (attribute.to_owned(), accessor.index());
    if !format.data_types.contains(&accessor.data_type())
        || !format.dimensions.contains(&accessor.dimensions())
    {
        let found = format!("{:?} of {:?}", accessor.dimensions(), accessor.data_type());
        let expected = format.words;
        return Err(ImportProblem::AccessorFormat { place, accessor: index, attribute, found, expected });
    }
    if accessor.count() == 0 || accessor.sparse().is_some_and(|sparse| sparse.count() == 0) {
        return Err(ImportProblem::AccessorEmpty { place, accessor: index, attribute });
    }
    check_bytes(accessor, &attribute, context)
}

/// Checks that all bytes of an accessor that has elements lie within its buffers, and the places of a sparse one in range.
pub fn check_bytes(accessor: &Accessor, attribute: &str, context: &Context) -> Result<(), ImportProblem> {
    let (place, attribute) = (context.place.to_owned(), attribute.to_owned());
    if !is_within_bounds(accessor, context) {
        return Err(ImportProblem::AccessorOutOfBounds { place, accessor: accessor.index(), attribute });
    }
    match misplaced(accessor, context) {
        Some(index) => {
            let (accessor, count) = (accessor.index(), accessor.count() as u64);
            Err(ImportProblem::SparseIndex { place, accessor, attribute, index, count })
        }
        None => Ok(()),
    }
}

/// The first place of a sparse accessor that is out of range, or not behind the one before.
fn misplaced(accessor: &Accessor, context: &Context) -> Option<u64> {
    let sparse = accessor.sparse()?;
    let (indices, count) = (sparse.indices(), accessor.count() as u64);
    let (view, size) = (indices.view(), indices.index_type().size());
    let bytes = context.buffers.get(view.buffer().index())?;
    let bytes = bytes.get(view.offset()..)?.get(indices.offset()..)?;
    let rows = bytes.chunks(view.stride().unwrap_or(size)).take(sparse.count());
    let places =
        rows.map(|row| row.iter().take(size).rev().fold(0, |value, &byte| value << 8 | u64::from(byte)));
    let mut next = 0;
    for place in places {
        if place < next || place >= count {
            return Some(place);
        }
        next = place + 1;
    }
    None
}

/// Whether all bytes of an accessor that has elements lie within its buffers.
pub fn is_within_bounds(accessor: &Accessor, context: &Context) -> bool {
    let (size, count) = (accessor.size() as u64, accessor.count() as u64);
    let base = match accessor.view() {
        Some(view) => fits(&view, accessor.offset(), count, size, context.buffers),
        None => count <= most_zeros(context.buffers),
    };
    let Some(sparse) = accessor.sparse() else { return base };
    let (indices, values) = (sparse.indices(), sparse.values());
    let (replaced, index_size) = (sparse.count() as u64, indices.index_type().size() as u64);
    base && replaced <= count
        && fits(&indices.view(), indices.offset(), replaced, index_size, context.buffers)
        && fits(&values.view(), values.offset(), replaced, size, context.buffers)
}

/// Whether `count` elements of `size` bytes from `offset` on lie within the view, and the view within its buffer.
fn fits(view: &buffer::View, offset: usize, count: u64, size: u64, buffers: &[Vec<u8>]) -> bool {
    let stride = view.stride().map_or(size, |stride| stride as u64);
    let end =
        (count - 1).checked_mul(stride).and_then(|end| end.checked_add(size)?.checked_add(offset as u64));
    let view_end = (view.offset() as u64).checked_add(view.length() as u64);
    let held = buffers.get(view.buffer().index()).map_or(0, |bytes| bytes.len() as u64);
    stride >= size
        && end.is_some_and(|end| end <= view.length() as u64)
        && view_end.is_some_and(|end| end <= held)
}
