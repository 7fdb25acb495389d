//! KHR_draco_mesh_compression: the accessors of compressed primitives get their data.

use std::collections::{BTreeMap, BTreeSet};

use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute};
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::buffer::Target;
use gltf::json::mesh::Mode;
use gltf::json::validation::Checked::Valid;
use gltf::json::{Accessor, Index, Value};

use super::extensions::{CompressedPrimitive, Extensions};
use super::storage::Storage;
use crate::error::ImportProblem;

/// Most triangles that one encoded byte can stand for: entropy coding lets those of a regular mesh take next to nothing.
const FACES_PER_BYTE: u64 = 1024;

/// Most bytes of attributes of a triangle: three vertices with all that a vertex may have.
const BYTES_PER_FACE: u64 = 3 * 256;

/// Decodes every compressed primitive.
pub(super) fn decode(storage: &mut Storage, extensions: &Extensions) -> Result<(), ImportProblem> {
    // Primitives that share their data share their accessors too; each is decoded once.
    let mut by_view: BTreeMap<usize, Vec<(usize, usize, &CompressedPrimitive)>> = BTreeMap::new();
    for (&(mesh, primitive), compressed) in &extensions.primitives {
        by_view.entry(compressed.buffer_view).or_default().push((mesh, primitive, compressed));
    }
    let mut filled = BTreeSet::new();
    for (view, primitives) in by_view {
        let decoded = decode_view(storage, view, &|| place(primitives[0].0, primitives[0].1))?;
        for (mesh, primitive, compressed) in primitives {
            fill(storage, (mesh, primitive), compressed, &decoded, &mut filled)?;
        }
    }
    Ok(())
}

fn place(mesh: usize, primitive: usize) -> String {
    format!("mesh {mesh}, primitive {primitive}, compressed by Draco")
}

fn decode_view(
    storage: &mut Storage,
    view: usize,
    place: &dyn Fn() -> String,
) -> Result<Mesh, ImportProblem> {
    let damaged = |detail: String| ImportProblem::Undecodable { place: place(), detail };
    let bytes = storage.root.buffer_views.get(view).and_then(|view| storage.view(view)).ok_or_else(|| {
        damaged(format!("buffer view {view} is not in the file, or reaches outside its buffer"))
    })?;
    let most = (storage.limits.max_triangles as u64).min(bytes.len() as u64 * FACES_PER_BYTE);
    let limits = DecodeLimits::default()
        .with_max_points(3 * most)
        .with_max_faces(most)
        .with_max_decoded_bytes(storage.limits.bytes.min(most * BYTES_PER_FACE));
    let mut mesh = Mesh::new();
    MeshDecoder::new()
        .decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh)
        .map_err(|error| damaged(error.to_string()))?;
    Ok(mesh)
}

/// Gives decoded data to the accessors of a primitive.
fn fill(
    storage: &mut Storage,
    (mesh, primitive): (usize, usize),
    compressed: &CompressedPrimitive,
    decoded: &Mesh,
    filled: &mut BTreeSet<usize>,
) -> Result<(), ImportProblem> {
    let damaged = |detail: String| ImportProblem::Undecodable { place: place(mesh, primitive), detail };
    let named = &storage.root.meshes[mesh].primitives[primitive];
    let attributes: Vec<(String, Index<Accessor>)> = named
        .attributes
        .iter()
        .filter_map(|(name, &index)| match name {
            Valid(semantic) => Some((semantic.to_string(), index)),
            _ => None,
        })
        .collect();
    let indices = named.indices;
    for (name, index) in attributes {
        let Some(&id) = compressed.attributes.get(&name) else { continue };
        if !filled.insert(index.value()) {
            continue;
        }
        let attribute = decoded
            .attribute_by_unique_id(id)
            .ok_or_else(|| damaged(format!("its data hold no attribute {id} for {name}")))?;
        let accessor = storage
            .root
            .get(index)
            .ok_or_else(|| damaged(format!("accessor {index} of {name} is not in the file")))?;
        let (Valid(GenericComponentType(component)), Valid(shape)) =
            (accessor.component_type, accessor.type_)
        else {
            return Err(damaged(format!("accessor {index} of {name} has no valid format")));
        };
        let width = width(shape).ok_or_else(|| damaged(format!("{name} is a matrix")))?;
        let points = decoded.num_points();
        // Rows are aligned, as those of vertex attributes must be.
        let row = (width * component.size()).next_multiple_of(4);
        storage.charge(points.checked_mul(row + width * 4))?;
        let bytes = attribute_bytes(attribute, points, width, component);
        let stride = (row != width * component.size()).then_some(gltf::json::buffer::Stride(row));
        let view = storage.store(&bytes, stride, Some(Valid(Target::ArrayBuffer)));
        let view = storage.root.push(view);
        let accessor = &mut storage.root.accessors[index.value()];
        (accessor.buffer_view, accessor.byte_offset, accessor.sparse) = (Some(view), None, None);
        accessor.count = points.into();
    }
    let indices = fill_indices(storage, indices, decoded, filled)?;
    let primitive = &mut storage.root.meshes[mesh].primitives[primitive];
    primitive.indices = Some(indices);
    // A strip is decoded to its triangles.
    primitive.mode = Valid(Mode::Triangles);
    Ok(())
}

/// Puts the triangles into the accessor of the indices, or a new one where the primitive has none.
fn fill_indices(
    storage: &mut Storage,
    indices: Option<Index<Accessor>>,
    decoded: &Mesh,
    filled: &mut BTreeSet<usize>,
) -> Result<Index<Accessor>, ImportProblem> {
    if let Some(index) = indices.filter(|index| filled.contains(&index.value())) {
        return Ok(index);
    }
    let count = 3 * decoded.num_faces();
    storage.charge(count.checked_mul(4))?;
    let corners = decoded.faces().iter().flatten().map(|point| point.0);
    let bytes: Vec<u8> = corners.flat_map(u32::to_le_bytes).collect();
    let view = storage.store(&bytes, None, Some(Valid(Target::ElementArrayBuffer)));
    let accessor = Accessor {
        buffer_view: Some(storage.root.push(view)),
        byte_offset: None,
        count: count.into(),
        component_type: Valid(GenericComponentType(ComponentType::U32)),
        extensions: None,
        extras: None,
        type_: Valid(Type::Scalar),
        min: None::<Value>,
        max: None,
        name: None,
        normalized: false,
        sparse: None,
    };
    match indices.and_then(|index| Some((index, storage.root.accessors.get_mut(index.value())?))) {
        Some((index, place)) => {
            filled.insert(index.value());
            *place = Accessor { name: place.name.take(), extras: place.extras.take(), ..accessor };
            Ok(index)
        }
        None => Ok(storage.root.push(accessor)),
    }
}

fn width(shape: Type) -> Option<usize> {
    match shape {
        Type::Scalar => Some(1),
        Type::Vec2 => Some(2),
        Type::Vec3 => Some(3),
        Type::Vec4 => Some(4),
        _ => None,
    }
}

/// The attribute of every point as the accessor wants it: in its component type, rows aligned to four bytes.
///
/// Draco keeps integers of up to 16 bits exactly, and these survive the way through f32.
fn attribute_bytes(
    attribute: &PointAttribute,
    points: usize,
    width: usize,
    component: ComponentType,
) -> Vec<u8> {
    let row = (width * component.size()).next_multiple_of(4);
    let mut bytes = Vec::with_capacity(points * row);
    for values in attribute.read_f32s(points, width).chunks_exact(width) {
        for &value in values {
            match component {
                ComponentType::I8 => bytes.extend((value as i8).to_le_bytes()),
                ComponentType::U8 => bytes.push(value as u8),
                ComponentType::I16 => bytes.extend((value as i16).to_le_bytes()),
                ComponentType::U16 => bytes.extend((value as u16).to_le_bytes()),
                ComponentType::U32 => bytes.extend((value as u32).to_le_bytes()),
                ComponentType::F32 => bytes.extend(value.to_le_bytes()),
            }
        }
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    }
    bytes
}
