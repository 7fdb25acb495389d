//! Morph targets and skins, in the pose without animation: displacements weighted by the file's weights, vertices moved by the
//! joints' nodes. The author's rest pose, without joints, may be another one that does not fit the scene around it.

use glam::{DAffine3, DMat4, DVec3};
use gltf::json::validation::Checked::Valid;
use gltf::json::{Accessor, Index, mesh};
use gltf::{Document, Semantic};

use super::storage::Storage;
use super::values::{self, Values};
use crate::error::ImportProblem;
use crate::labels::node_label;
use crate::nodes::{normal_matrix, walk};
use crate::placement::world_matrices;

/// Most names that a warning lists.
const SHOWN_NODES: usize = 5;

/// A node whose mesh has morph targets or a skin.
pub(super) struct PosedNode {
    node: usize,
    label: String,
    mesh: usize,
    weights: Vec<f64>,
    skin: Option<PosedSkin>,
}

/// The joints of a skin.
struct PosedSkin {
    inverse_bind_matrices: Option<Index<Accessor>>,
    /// Joint to the skinned node's own coordinates, the inverse bind matrix left out.
    joints: Vec<DMat4>,
}

/// The nodes of the default scene that have a pose, and a warning each for morph targets and skins.
///
/// `room` are the bytes that their matrices may take: many nodes may share a skin of many joints.
pub(super) fn find(
    document: &Document,
    mut room: u64,
    warnings: &mut Vec<String>,
) -> Result<Vec<PosedNode>, ImportProblem> {
    // The walk costs little, but most files have neither.
    let morphs = |mesh: gltf::Mesh| mesh.primitives().any(|primitive| primitive.morph_targets().len() > 0);
    if document.skins().len() == 0 && !document.meshes().any(morphs) {
        return Ok(Vec::new());
    }
    let mut posed = Vec::new();
    let (mut morphed, mut skinned) = (Vec::new(), Vec::new());
    // Finds cycles before the joints' matrices are multiplied.
    let placed = walk(document)?;
    let world = world_matrices(document);
    for placed in placed {
        let Some(mesh) = placed.node.mesh().filter(|_| placed.is_visible) else { continue };
        let label = node_label(&placed.node);
        let weights = placed.node.weights().or(mesh.weights()).unwrap_or_default();
        let weights: Vec<f64> = weights.iter().map(|&weight| f64::from(weight)).collect();
        let has_targets = mesh.primitives().any(|primitive| primitive.morph_targets().len() > 0);
        if has_targets {
            morphed.push(label.clone());
        }
        let skin = placed.node.skin();
        // The mesh stands where its joints are, wherever its node is; so its node has to be taken out again.
        let inverse = DMat4::from(placed.world.inverse());
        if skin.is_some() && !inverse.is_finite() {
            return Err(ImportProblem::FlatNode { primitive: label });
        }
        let matrices = skin.iter().map(|skin| (skin.joints().count() * size_of::<DMat4>()) as u64).sum();
        room = room.checked_sub(matrices).ok_or_else(|| ImportProblem::Undecodable {
            place: label.clone(),
            detail: "all skins together have more joints than a file of this length can need".to_owned(),
        })?;
        let skin = skin.map(|skin| PosedSkin {
            inverse_bind_matrices: skin
                .inverse_bind_matrices()
                .map(|accessor| Index::new(accessor.index() as u32)),
            joints: skin.joints().map(|joint| inverse * world[joint.index()]).collect(),
        });
        if skin.is_some() {
            skinned.push(label.clone());
        }
        let moves = has_targets && weights.iter().any(|&weight| weight != 0.0);
        if moves || skin.is_some() {
            posed.push(PosedNode { node: placed.node.index(), label, mesh: mesh.index(), weights, skin });
        }
    }
    if !morphed.is_empty() {
        warnings.push(format!("morph targets baked at the file's own weights: {}", list(&morphed)));
    }
    if !skinned.is_empty() {
        warnings.push(format!("skins baked as the joints stand without animation: {}", list(&skinned)));
    }
    Ok(posed)
}

fn list(labels: &[String]) -> String {
    match labels.split_at_checked(SHOWN_NODES) {
        Some((shown, rest)) if !rest.is_empty() => format!("{} and {} more", shown.join(", "), rest.len()),
        _ => labels.join(", "),
    }
}

/// Gives the node a mesh of its own, in its pose.
pub(super) fn bake(storage: &mut Storage, posed: &PosedNode) -> Result<(), ImportProblem> {
    let mut mesh = storage.root.meshes[posed.mesh].clone();
    for (index, primitive) in mesh.primitives.iter_mut().enumerate() {
        bake_primitive(storage, posed, primitive, &|| format!("{}, primitive {index}", posed.label))?;
    }
    mesh.weights = None;
    let mesh = storage.root.push(mesh);
    let node = &mut storage.root.nodes[posed.node];
    (node.mesh, node.skin, node.weights) = (Some(mesh), None, None);
    Ok(())
}

fn bake_primitive(
    storage: &mut Storage,
    posed: &PosedNode,
    primitive: &mut mesh::Primitive,
    place: &dyn Fn() -> String,
) -> Result<(), ImportProblem> {
    let targets = primitive.targets.take().unwrap_or_default();
    let vertices = primitive
        .attributes
        .get(&Valid(Semantic::Positions))
        .and_then(|&index| storage.root.get(index))
        .map_or(0, |accessor| accessor.count.0 as usize);
    let matrices = match &posed.skin {
        Some(skin) => skin_matrices(storage, skin, primitive, vertices, place)?,
        None => None,
    };
    primitive.attributes.retain(|name, _| !matches!(name, Valid(Semantic::Joints(_) | Semantic::Weights(_))));
    type Displacement = fn(&mesh::MorphTarget) -> Option<Index<Accessor>>;
    type Movement = fn(&DMat4, DVec3) -> DVec3;
    let moved: [(Semantic, Displacement, Movement); 3] = [
        (Semantic::Positions, |target| target.positions, |matrix, point| matrix.transform_point3(point)),
        (
            Semantic::Normals,
            |target| target.normals,
            |matrix, normal| {
                (normal_matrix(DAffine3::from_mat4(*matrix).matrix3) * normal).normalize_or(normal)
            },
        ),
        (
            Semantic::Tangents,
            |target| target.tangents,
            |matrix, tangent| matrix.transform_vector3(tangent).normalize_or(tangent),
        ),
    ];
    for (semantic, displacement, movement) in moved {
        let Some(attribute) = primitive.attributes.get_mut(&Valid(semantic.clone())) else { continue };
        let what = || format!("{}, {}", place(), semantic.to_string());
        let mut values = values::read(storage, *attribute, &what)?;
        let differs = |detail: &str| ImportProblem::Undecodable { place: what(), detail: detail.to_owned() };
        if !matches!(values.width, 3 | 4) || values.len() != vertices {
            return Err(differs("it has not one vector for each vertex"));
        }
        let mut vectors: Vec<DVec3> = values.rows().map(vector).collect();
        for (target, &weight) in targets.iter().zip(&posed.weights).filter(|(_, weight)| **weight != 0.0) {
            let Some(index) = displacement(target) else { continue };
            let displacements = values::read(storage, index, &what)?;
            if displacements.width != 3 || displacements.len() != vertices {
                return Err(differs("a morph target has not one vector for each vertex"));
            }
            for (vector, displacement) in vectors.iter_mut().zip(displacements.rows()) {
                *vector += weight * self::vector(displacement);
            }
        }
        if let Some(matrices) = &matrices {
            for (vector, matrix) in vectors.iter_mut().zip(matrices) {
                *vector = movement(matrix, *vector);
            }
        }
        let width = values.width;
        for (row, vector) in values.numbers.chunks_exact_mut(width).zip(&vectors) {
            row[..3].copy_from_slice(&vector.as_vec3().to_array());
        }
        let accessor = storage.floats(&values.numbers, width)?;
        *attribute = storage.root.push(accessor);
    }
    Ok(())
}

fn vector(row: &[f32]) -> DVec3 {
    DVec3::new(f64::from(row[0]), f64::from(row[1]), f64::from(row[2]))
}

/// The matrix of every vertex: its joints' matrices, weighted. `None` where the primitive has no joints.
fn skin_matrices(
    storage: &mut Storage,
    skin: &PosedSkin,
    primitive: &mesh::Primitive,
    vertices: usize,
    place: &dyn Fn() -> String,
) -> Result<Option<Vec<DMat4>>, ImportProblem> {
    let what = || format!("{}, joints and weights", place());
    let wrong = |detail: String| ImportProblem::Undecodable { place: what(), detail };
    let mut joints = skin.joints.clone();
    if let Some(accessor) = skin.inverse_bind_matrices {
        let inverse = values::read(storage, accessor, &|| format!("{}, inverse bind matrices", place()))?;
        if inverse.width != 16 || inverse.len() < joints.len() {
            return Err(wrong("its skin has not one inverse bind matrix for each joint".to_owned()));
        }
        for (joint, row) in joints.iter_mut().zip(inverse.rows()) {
            let mut columns = [0.0; 16];
            columns.iter_mut().zip(row).for_each(|(column, &value)| *column = f64::from(value));
            *joint *= DMat4::from_cols_array(&columns);
        }
    }
    let mut influences: Vec<(Values, Values)> = Vec::new();
    for set in 0.. {
        let attribute = |semantic| primitive.attributes.get(&Valid(semantic)).copied();
        let (Some(indices), Some(weights)) =
            (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set)))
        else {
            break;
        };
        let (indices, weights) =
            (values::read(storage, indices, &what)?, values::read(storage, weights, &what)?);
        if [&indices, &weights].iter().any(|values| values.width != 4 || values.len() != vertices) {
            return Err(wrong("there are not four of each for each vertex".to_owned()));
        }
        influences.push((indices, weights));
    }
    if influences.is_empty() {
        return Ok(None);
    }
    storage.charge(vertices.checked_mul(size_of::<DMat4>()))?;
    let mut matrices = Vec::with_capacity(vertices);
    for vertex in 0..vertices {
        let (mut sum, mut total, mut first) = (DMat4::ZERO, 0.0, None);
        for (indices, weights) in &influences {
            let at = 4 * vertex..4 * vertex + 4;
            for (&index, &weight) in indices.numbers[at.clone()].iter().zip(&weights.numbers[at]) {
                let (joint, weight) = (index as usize, f64::from(weight));
                if !weight.is_finite() {
                    return Err(wrong(format!("vertex {vertex} has a weight of {weight}")));
                }
                let matrix = joints.get(joint).ok_or_else(|| {
                    wrong(format!("vertex {vertex} hangs on joint {joint} of {}", joints.len()))
                })?;
                first.get_or_insert(*matrix);
                sum += weight * *matrix;
                total += weight;
            }
        }
        // Weights of integers rarely add up to 1, and those of a vertex that hangs on nothing not at all.
        matrices.push(if total > 0.0 { sum * (1.0 / total) } else { first.unwrap_or(DMat4::IDENTITY) });
    }
    Ok(Some(matrices))
}
