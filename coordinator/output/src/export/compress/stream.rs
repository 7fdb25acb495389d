//! Vertices and indices as the filters of meshoptimizer have them, and streams of its codecs.

use gltf::json::accessor::ComponentType;
use meshopt::{
    EncodeExpMode, decode_filter_exp, encode_filter_exp, encode_filter_oct, encode_index_buffer,
    encode_vertex_buffer_level,
};

use super::super::ExportError;

/// Version of the vertex codec that the extension allows.
const VERSION: i32 = 0;

/// How elements are encoded: those of one kind can be in one stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Kind {
    /// The extension's name of the codec.
    pub(super) mode: Mode,
    /// The extension's name of the filter.
    pub(super) filter: Option<&'static str>,
    /// Bytes of a decoded element.
    pub(super) stride: usize,
}

/// The codecs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Mode {
    Attributes,
    Triangles,
}

impl Mode {
    /// The extension's name.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Attributes => "ATTRIBUTES",
            Self::Triangles => "TRIANGLES",
        }
    }
}

/// Filtered elements, and what decoders make of them.
pub(super) struct Elements {
    pub(super) kind: Kind,
    pub(super) component: ComponentType,
    /// Indices have four bytes each, whatever the stride.
    pub(super) bytes: Vec<u8>,
    pub(super) count: usize,
}

impl Elements {
    fn attributes<const BYTES: usize>(
        rows: Vec<[u8; BYTES]>,
        filter: Option<&'static str>,
        component: ComponentType,
    ) -> Self {
        let kind = Kind { mode: Mode::Attributes, filter, stride: BYTES };
        Self { kind, component, count: rows.len(), bytes: rows.into_flattened() }
    }
}

/// Which values of vectors share an exponent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Exponents {
    /// Those of a vector: its largest has all bits.
    Vector,
    /// Those of a component, over all vectors: its steps are even.
    Component,
    /// None: each value has all bits.
    Separate,
}

/// Floats of so many bits each, from 1 to 24, with what they become.
pub(super) fn exponential<const WIDTH: usize, const BYTES: usize>(
    vectors: &[[f32; WIDTH]],
    bits: i32,
    exponents: Exponents,
) -> (Elements, Vec<f32>) {
    let mode = match exponents {
        Exponents::Vector => EncodeExpMode::SharedVector,
        Exponents::Component => EncodeExpMode::SharedComponent,
        Exponents::Separate => EncodeExpMode::Separate,
    };
    let mut rows = encode_filter_exp(vectors, bits, mode);
    let bytes = rows.iter().map(|row| bytes_of(row.map(u32::to_le_bytes))).collect::<Vec<[u8; BYTES]>>();
    decode_filter_exp(&mut rows);
    let decoded = rows.into_flattened().into_iter().map(f32::from_bits).collect();
    (Elements::attributes(bytes, Some("EXPONENTIAL"), ComponentType::F32), decoded)
}

/// Floats as they are.
pub(super) fn exact<const WIDTH: usize, const BYTES: usize>(vectors: &[[f32; WIDTH]]) -> Elements {
    let rows = vectors.iter().map(|row| bytes_of(row.map(f32::to_le_bytes))).collect::<Vec<[u8; BYTES]>>();
    Elements::attributes(rows, None, ComponentType::F32)
}

/// Unit vectors of so many bits; a fourth component is a sign.
pub(super) fn directions<const WIDTH: usize>(vectors: &[[f32; WIDTH]], bits: i32) -> Elements {
    let padded = |row: &[f32; WIDTH]| std::array::from_fn(|at| row.get(at).copied().unwrap_or(0.0));
    let rows = encode_filter_oct::<i16>(&vectors.iter().map(padded).collect::<Vec<[f32; 4]>>(), bits);
    let rows = rows.iter().map(|row| bytes_of(row.map(i16::to_le_bytes))).collect::<Vec<[u8; 8]>>();
    Elements::attributes(rows, Some("OCTAHEDRAL"), ComponentType::I16)
}

/// Indices of triangles, in 16 bits where these suffice.
pub(super) fn triangles(indices: &[u32], vertices: usize) -> Elements {
    // 65535 itself restarts a primitive.
    let is_short = vertices <= usize::from(u16::MAX);
    let component = if is_short { ComponentType::U16 } else { ComponentType::U32 };
    Elements {
        kind: Kind { mode: Mode::Triangles, filter: None, stride: component.size() },
        component,
        bytes: indices.iter().flat_map(|index| index.to_le_bytes()).collect(),
        count: indices.len(),
    }
}

/// The bytes of all numbers of a row.
fn bytes_of<const NUMBERS: usize, const SIZE: usize, const BYTES: usize>(
    row: [[u8; SIZE]; NUMBERS],
) -> [u8; BYTES] {
    std::array::from_fn(|at| row[at / SIZE][at % SIZE])
}

/// Elements of one kind as a stream.
///
/// # Errors
/// When there is no codec for their size.
pub(super) fn encode(kind: Kind, bytes: &[u8]) -> Result<Vec<u8>, ExportError> {
    fn rows<const BYTES: usize>(bytes: &[u8]) -> meshopt::Result<Vec<u8>> {
        encode_vertex_buffer_level(bytes.as_chunks::<BYTES>().0, 2, Some(VERSION))
    }
    let encoded = match (kind.mode, kind.stride) {
        (Mode::Triangles, _) => {
            let indices: Vec<u32> =
                bytes.as_chunks().0.iter().map(|index| u32::from_le_bytes(*index)).collect();
            let vertices = indices.iter().max().map_or(0, |largest| *largest as usize + 1);
            encode_index_buffer(&indices, vertices)
        }
        (Mode::Attributes, 4) => rows::<4>(bytes),
        (Mode::Attributes, 8) => rows::<8>(bytes),
        (Mode::Attributes, 12) => rows::<12>(bytes),
        (Mode::Attributes, 16) => rows::<16>(bytes),
        (Mode::Attributes, stride) => {
            return Err(ExportError::Compression(format!("elements have {stride} bytes")));
        }
    };
    encoded.map_err(|error| ExportError::Compression(error.to_string()))
}
