//! What the score reads of binary glTF files: lit triangles of one, reflectances of the other.

use std::fs;
use std::path::Path;

use glam::DVec3;
use gltf::accessor::{DataType, Dimensions, Iter};
use gltf::mesh::Mode;
use gltf::{Accessor, Gltf, Primitive, Semantic};

use super::ScoreError;
use crate::placement::world_matrices;

/// The triangles of a lit scene, in the world.
#[derive(Default)]
pub(super) struct LitTriangles {
    /// Corners, counter-clockwise seen from the front.
    pub(super) triangles: Vec<[DVec3; 3]>,
    /// Irradiance at the corners.
    pub(super) irradiances: Vec<[DVec3; 3]>,
    /// Vertices of all primitives.
    pub(super) vertices: usize,
}

/// Reads the triangles of a lit GLB.
pub(super) fn read(path: &Path) -> Result<LitTriangles, ScoreError> {
    let gltf = open(path)?;
    let world = world_matrices(&gltf);
    let mut lit = LitTriangles::default();
    for (node, primitive) in primitives(&gltf) {
        let name =
            || node.name().map_or_else(|| format!("node {}", node.index()), |name| format!("node {name}"));
        let unreadable = |what| ScoreError::Data { path: path.to_owned(), node: name(), what };
        let irradiance = primitive
            .get(&Semantic::Extras("IRRADIANCE".into()))
            .ok_or_else(|| ScoreError::NotLit { path: path.to_owned(), node: name() })?;
        let irradiances = vectors(&gltf, irradiance).ok_or_else(|| unreadable("_IRRADIANCE"))?;
        let positions: Vec<DVec3> = primitive
            .get(&Semantic::Positions)
            .and_then(|accessor| vectors(&gltf, accessor))
            .ok_or_else(|| unreadable("POSITION"))?
            .into_iter()
            .map(|position| world[node.index()].transform_point3(position))
            .collect();
        let mirrored = world[node.index()].determinant() < 0.0;
        for corners in indices(&gltf, &primitive, positions.len()).as_chunks::<3>().0 {
            let [a, b, c] = corners.map(|index| index as usize);
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            if corners.iter().any(|&corner| corner >= positions.len().min(irradiances.len())) {
                return Err(unreadable("indices"));
            }
            lit.triangles.push(corners.map(|corner| positions[corner]));
            lit.irradiances.push(corners.map(|corner| irradiances[corner]));
        }
        lit.vertices += positions.len();
    }
    Ok(lit)
}

/// Reads the diffuse reflectance, base colour x (1 - metallic), of each primitive of a GLB.
pub(super) fn read_reflectances(path: &Path) -> Result<Vec<DVec3>, ScoreError> {
    let gltf = open(path)?;
    let reflectance = |primitive: Primitive<'_>| {
        let pbr = primitive.material().pbr_metallic_roughness();
        let [r, g, b, _] = pbr.base_color_factor().map(f64::from);
        DVec3::new(r, g, b) * (1.0 - f64::from(pbr.metallic_factor()))
    };
    Ok(primitives(&gltf).into_iter().map(|(_, primitive)| reflectance(primitive)).collect())
}

fn open(path: &Path) -> Result<Gltf, ScoreError> {
    let bytes = fs::read(path).map_err(|source| ScoreError::Read { path: path.to_owned(), source })?;
    Gltf::from_slice(&bytes).map_err(|source| ScoreError::Gltf { path: path.to_owned(), source })
}

/// The triangle primitives of the default scene (the first, where none is), parents before children: the order that
/// references count in.
fn primitives(gltf: &Gltf) -> Vec<(gltf::Node<'_>, Primitive<'_>)> {
    let mut found = Vec::new();
    let mut visited = vec![false; gltf.nodes().len()];
    let scene = gltf.default_scene().or_else(|| gltf.scenes().next());
    let mut stack: Vec<_> = scene.iter().flat_map(|scene| scene.nodes()).collect();
    stack.reverse();
    while let Some(node) = stack.pop() {
        if std::mem::replace(&mut visited[node.index()], true) {
            continue;
        }
        let meshes = node.mesh().into_iter().flat_map(|mesh| mesh.primitives());
        found.extend(meshes.filter(|p| p.mode() == Mode::Triangles).map(|p| (node.clone(), p)));
        let children: Vec<_> = node.children().collect();
        stack.extend(children.into_iter().rev());
    }
    found
}

/// The rows of a float VEC3 accessor in the GLB's buffer.
fn vectors(gltf: &Gltf, accessor: Accessor<'_>) -> Option<Vec<DVec3>> {
    let typed = accessor.data_type() == DataType::F32 && accessor.dimensions() == Dimensions::Vec3;
    if !typed || accessor.count() == 0 {
        return None;
    }
    let rows = Iter::<[f32; 3]>::new(accessor, |buffer| blob(gltf, &buffer))?;
    Some(rows.map(|row| DVec3::from_array(row.map(f64::from))).collect())
}

/// The primitive's vertex indices, three per triangle; none where they cannot be read.
fn indices(gltf: &Gltf, primitive: &Primitive<'_>, vertices: usize) -> Vec<u32> {
    match primitive.indices() {
        None => (0..vertices as u32).collect(),
        Some(_) => {
            let reader = primitive.reader(|buffer| blob(gltf, &buffer));
            reader.read_indices().map(|indices| indices.into_u32().collect()).unwrap_or_default()
        }
    }
}

fn blob<'a>(gltf: &'a Gltf, buffer: &gltf::Buffer<'_>) -> Option<&'a [u8]> {
    let own = matches!(buffer.source(), gltf::buffer::Source::Bin);
    own.then_some(gltf.blob.as_deref()).flatten()
}
