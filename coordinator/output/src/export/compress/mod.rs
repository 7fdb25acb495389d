//! The output made small: EXT_meshopt_compression of vertices and indices, with KHR_mesh_quantization of directions.
//!
//! Positions keep steps of a 16,384th of the largest coordinate of a mesh, texture coordinates of a 4,096th, light a relative error of a
//! thousandth, what is shown of it one of half a screen's step, and directions 10 bits. Triangles and vertices are put in an order that
//! compresses well where nothing else has them. Other values keep their bits, and accessors that are used in other ways their bytes.
//!
//! | module | what lives there |
//! |---|---|
//! | `roles` | what each accessor is for |
//! | `order` | triangles and vertices in another order |
//! | `stream` | values encoded |
//! | `arena` | the new buffer |

mod arena;
mod order;
mod roles;
mod stream;

use gltf::json::Root;
use serde_json::Value;

use super::ExportError;
use super::attributes::components;
use arena::Arena;
use order::{orders, vertices};
use roles::{Role, can_be, roles};
use stream::{Elements, Exponents};

/// Bits of positions.
const POSITION_BITS: i32 = 16;

/// Bits of texture coordinates within [0, 1]; larger ones get more.
const COORDINATE_BITS: i32 = 14;

/// Bits of light, of the largest channel.
const LIGHT_BITS: i32 = 11;

/// Bits of colours, of the largest channel: with their sign, which is not used, these are a byte and the exponent.
const COLOUR_BITS: i32 = 9;

/// Bits of directions.
const DIRECTION_BITS: i32 = 10;

/// Most bits of a number.
const MOST_BITS: i32 = 24;

/// Compresses the vertices and indices of a document whose only buffer is `binary`; returns the new one. It is not known what names
/// accessors and views below `pinned`: these stay.
///
/// # Errors
/// When an accessor's bytes are not there.
pub(super) fn compress(root: &mut Root, binary: Vec<u8>, pinned: usize) -> Result<Vec<u8>, ExportError> {
    let document = gltf::Document::from_json_without_validation(root.clone());
    let buffers = [binary];
    let mut roles = roles(root);
    let accessors: Vec<gltf::Accessor> = document.accessors().collect();
    for (index, role) in &mut roles {
        let accessor = accessors.get(*index);
        if *index < pinned || !accessor.is_some_and(|accessor| can_be(accessor, *role)) {
            *role = Role::Other;
        }
    }
    let read = |index: usize| {
        let values = accessors.get(index).and_then(|accessor| components(accessor, &buffers));
        values.ok_or_else(|| ExportError::Buffer(format!("accessor {index}")))
    };
    let vertices_of = vertices(root);
    let orders =
        orders(root, &roles, |index| Ok(read(index)?.into_iter().map(|value| value as u32).collect()))?;
    let mut arena = Arena::default();
    for (&index, &role) in roles.iter().filter(|(_, role)| **role != Role::Other) {
        let order = orders.get(&index);
        // Bounds need not hold any more.
        let accessor = &mut root.accessors[index];
        (accessor.min, accessor.max) = (None, None);
        if role == Role::Triangles {
            let indices = match order {
                Some(order) => order.indices.clone(),
                None => read(index)?.into_iter().map(|value| value as u32).collect(),
            };
            let count = order.map(|order| order.vertices.len()).or_else(|| vertices_of.get(&index).copied());
            arena.put(root, index, stream::triangles(&indices, count.unwrap_or(usize::MAX)));
            continue;
        }
        let width = accessors[index].dimensions().multiplicity();
        let values = read(index)?;
        let values: Vec<f32> = match order {
            Some(order) => order
                .vertices
                .iter()
                .flat_map(|vertex| &values[*vertex as usize * width..][..width])
                .map(|value| *value as f32)
                .collect(),
            None => values.into_iter().map(|value| value as f32).collect(),
        };
        let (elements, bounds) = match width {
            1 => encoded::<1, 4>(role, &values),
            2 => encoded::<2, 8>(role, &values),
            3 => encoded::<3, 12>(role, &values),
            _ => encoded::<4, 16>(role, &values),
        };
        if let Some([min, max]) = bounds {
            let accessor = &mut root.accessors[index];
            (accessor.min, accessor.max) = (Some(min), Some(max));
        }
        arena.put(root, index, elements);
    }
    let [binary] = buffers;
    arena.finish(root, binary, pinned)
}

/// The values of an attribute as elements. Positions come with their bounds, which the format demands.
fn encoded<const WIDTH: usize, const BYTES: usize>(
    role: Role,
    values: &[f32],
) -> (Elements, Option<[Value; 2]>) {
    let vectors = values.as_chunks::<WIDTH>().0;
    let exponential = stream::exponential::<WIDTH, BYTES>;
    let elements = match role {
        Role::Position => {
            let (elements, decoded) = exponential(vectors, POSITION_BITS, Exponents::Component);
            let bound = |pick: fn(f32, f32) -> f32| -> Value {
                let component = |at: usize| decoded.iter().skip(at).step_by(WIDTH).copied().reduce(pick);
                (0..WIDTH).filter_map(component).collect()
            };
            return (elements, Some([bound(f32::min), bound(f32::max)]));
        }
        Role::Coordinates => {
            let largest = values.iter().fold(1.0_f32, |largest, value| largest.max(value.abs()));
            let bits = COORDINATE_BITS + largest.log2().ceil() as i32;
            exponential(vectors, bits.min(MOST_BITS), Exponents::Component).0
        }
        Role::Light => exponential(vectors, LIGHT_BITS, Exponents::Vector).0,
        // Alpha is mostly 1, and colours may be far below.
        Role::Colour if WIDTH == 4 => exponential(vectors, COLOUR_BITS, Exponents::Separate).0,
        Role::Colour => exponential(vectors, COLOUR_BITS, Exponents::Vector).0,
        Role::Direction => stream::directions(vectors, DIRECTION_BITS),
        _ => stream::exact::<WIDTH, BYTES>(vectors),
    };
    (elements, None)
}
