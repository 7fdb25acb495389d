//! EXT_meshopt_compression and KHR_meshopt_compression, which differ in the version of the attributes' codec and in a
//! filter for colours: meshoptimizer's own decoders read both.

use meshopt::{
    decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat, decode_index_buffer,
    decode_index_sequence, decode_vertex_buffer,
};

use super::extensions::{CompressedView, Extensions, Filter, Mode};
use super::storage::Storage;
use crate::error::ImportProblem;

/// Most bytes of attributes that one encoded byte can stand for: four bytes in each of the 256 elements of a block, where all of them
/// repeat. A triangle takes a byte at least, and so does an index.
const BYTES_PER_BYTE: usize = 1024;

/// Puts the decoded bytes in place of every compressed view's.
pub(super) fn decode(storage: &mut Storage, extensions: &Extensions) -> Result<(), ImportProblem> {
    for (&index, compressed) in &extensions.views {
        let damaged = |detail: &str| ImportProblem::Undecodable {
            place: format!("buffer view {index}, compressed by meshoptimizer"),
            detail: detail.to_owned(),
        };
        check(compressed).map_err(damaged)?;
        let length = compressed.count.checked_mul(compressed.byte_stride);
        storage.charge(length)?;
        // Once more while the decoder holds it.
        storage.charge(length)?;
        let source = storage
            .part(compressed.buffer, compressed.byte_offset, compressed.byte_length)
            .ok_or_else(|| damaged("its data reach outside their buffer"))?;
        let bytes = decode_view(source, compressed).map_err(|error| damaged(&error.to_string()))?;
        let view = storage.root.buffer_views.get(index).ok_or_else(|| damaged("there is no such view"))?;
        let (stride, target) = (view.byte_stride, view.target);
        let decoded = storage.store(&bytes, stride, target);
        let view = &mut storage.root.buffer_views[index];
        *view = gltf::json::buffer::View { name: view.name.take(), extras: view.extras.take(), ..decoded };
    }
    Ok(())
}

/// Checks the extension's limits of count, stride and filter.
fn check(view: &CompressedView) -> Result<(), &'static str> {
    let stride = view.byte_stride;
    let fits = match view.mode {
        Mode::Attributes => stride.is_multiple_of(4) && (4..=256).contains(&stride),
        Mode::Triangles => matches!(stride, 2 | 4) && view.count.is_multiple_of(3),
        Mode::Indices => matches!(stride, 2 | 4),
    };
    let filtered = match view.filter {
        Filter::None => true,
        Filter::Octahedral | Filter::Color => matches!(stride, 4 | 8),
        Filter::Quaternion => stride == 8,
        Filter::Exponential => true,
    };
    if !fits {
        return Err("its stride or count does not suit its mode");
    }
    let most = match view.mode {
        Mode::Attributes => view.byte_length.saturating_mul(BYTES_PER_BYTE) / stride,
        Mode::Triangles => view.byte_length.saturating_mul(3),
        Mode::Indices => view.byte_length,
    };
    if view.count > most {
        return Err("its data are too short for so many elements");
    }
    if !filtered || (view.filter != Filter::None && view.mode != Mode::Attributes) {
        return Err("its filter does not suit its mode or stride");
    }
    Ok(())
}

fn decode_view(source: &[u8], view: &CompressedView) -> meshopt::Result<Vec<u8>> {
    let count = view.count;
    Ok(match (view.mode, view.byte_stride) {
        (Mode::Triangles, 2) => short(&decode_index_buffer(source, count)?),
        (Mode::Triangles, _) => long(&decode_index_buffer(source, count)?),
        (Mode::Indices, 2) => short(&decode_index_sequence(source, count)?),
        (Mode::Indices, _) => long(&decode_index_sequence(source, count)?),
        (Mode::Attributes, stride) => {
            let mut bytes = attributes(source, count, stride / 4)?;
            match view.filter {
                Filter::None => {}
                Filter::Octahedral if stride == 4 => as_bytes(&mut bytes, decode_filter_oct),
                Filter::Octahedral => as_shorts(&mut bytes, decode_filter_oct),
                Filter::Color if stride == 4 => as_unsigned_bytes(&mut bytes, decode_filter_color),
                Filter::Color => as_unsigned_shorts(&mut bytes, decode_filter_color),
                Filter::Quaternion => as_shorts(&mut bytes, decode_filter_quat),
                Filter::Exponential => {
                    in_rows::<4, [u32; 1]>(
                        &mut bytes,
                        |row| [u32::from_le_bytes(row)],
                        |[word]| word.to_le_bytes(),
                        decode_filter_exp,
                    );
                }
            }
            bytes
        }
    })
}

fn short(indices: &[u16]) -> Vec<u8> {
    indices.iter().flat_map(|index| index.to_le_bytes()).collect()
}

fn long(indices: &[u32]) -> Vec<u8> {
    indices.iter().flat_map(|index| index.to_le_bytes()).collect()
}

/// An element of `N` words; the decoder takes the size from the type.
#[derive(Clone)]
struct Element<const WORDS: usize>([u32; WORDS]);

impl<const WORDS: usize> Default for Element<WORDS> {
    fn default() -> Self {
        Self([0; WORDS])
    }
}

fn elements<const WORDS: usize>(source: &[u8], count: usize) -> meshopt::Result<Vec<u8>> {
    let elements = decode_vertex_buffer::<Element<WORDS>>(source, count)?;
    let mut bytes = Vec::with_capacity(count * WORDS * 4);
    for Element(words) in &elements {
        append(&mut bytes, words);
    }
    Ok(bytes)
}

/// The same code for elements of all sizes: it would be compiled for each of them.
fn append(bytes: &mut Vec<u8>, words: &[u32]) {
    bytes.extend(words.iter().flat_map(|word| word.to_ne_bytes()));
}

/// Elements of 1 to 64 words.
pub(super) fn attributes(source: &[u8], count: usize, words: usize) -> meshopt::Result<Vec<u8>> {
    macro_rules! sizes {
        ($($words:literal)*) => {
            match words {
                $($words => elements::<$words>(source, count),)*
                _ => Err(meshopt::Error::Parse("elements have 1 to 64 words".to_owned())),
            }
        };
    }
    sizes!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32
        33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64)
}

/// Filters rows of `SIZE` bytes as values of a type of their own.
fn in_rows<const SIZE: usize, T>(
    bytes: &mut [u8],
    from: impl Fn([u8; SIZE]) -> T,
    to: impl Fn(&T) -> [u8; SIZE],
    filter: impl Fn(&mut [T]),
) {
    let (rows, _) = bytes.as_chunks_mut::<SIZE>();
    let mut values: Vec<T> = rows.iter().map(|row| from(*row)).collect();
    filter(&mut values);
    for (row, value) in rows.iter_mut().zip(&values) {
        *row = to(value);
    }
}

fn as_bytes(bytes: &mut [u8], filter: impl Fn(&mut [[i8; 4]])) {
    in_rows::<4, _>(bytes, |row| row.map(|byte| byte as i8), |row| row.map(|byte| byte as u8), filter);
}

fn as_unsigned_bytes(bytes: &mut [u8], filter: impl Fn(&mut [[u8; 4]])) {
    filter(bytes.as_chunks_mut::<4>().0);
}

fn as_shorts(bytes: &mut [u8], filter: impl Fn(&mut [[i16; 4]])) {
    let from = |[a, b, c, d, e, f, g, h]: [u8; 8]| [[a, b], [c, d], [e, f], [g, h]].map(i16::from_le_bytes);
    in_rows::<8, _>(bytes, from, |row| joined(row.map(i16::to_le_bytes)), filter);
}

fn as_unsigned_shorts(bytes: &mut [u8], filter: impl Fn(&mut [[u16; 4]])) {
    let from = |[a, b, c, d, e, f, g, h]: [u8; 8]| [[a, b], [c, d], [e, f], [g, h]].map(u16::from_le_bytes);
    in_rows::<8, _>(bytes, from, |row| joined(row.map(u16::to_le_bytes)), filter);
}

fn joined([[a, b], [c, d], [e, f], [g, h]]: [[u8; 2]; 4]) -> [u8; 8] {
    [a, b, c, d, e, f, g, h]
}

#[cfg(test)]
mod tests {
    use meshopt::encode_vertex_buffer_level;

    use super::*;

    #[test]
    fn elements_of_every_size() {
        macro_rules! check {
            ($($words:literal)*) => {
                $({
                    let rows: Vec<[u8; 4 * $words]> =
                        (0..300usize).map(|row| std::array::from_fn(|byte| (row * 7 + byte * row / 3) as u8)).collect();
                    let encoded = encode_vertex_buffer_level(&rows, 2, Some(1)).unwrap();
                    let decoded = attributes(&encoded, 300, $words).unwrap();
                    assert_eq!(decoded, rows.as_flattened());
                })*
            };
        }
        check!(1 2 3 5 8 13 21 33 63 64);
    }
}
