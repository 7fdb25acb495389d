//! Lit meshes from the values at the vertices, of a finished bake or one under way.

use glam::DVec3;

use crate::light_parts::LightPart;
use crate::lit::{LitMesh, LitTriangle, LitVertex};
use crate::mesh::{Mesh, Share, VertexId, triangulate};
use crate::output_mesh::add_sealed;
use crate::refinement::{RevealedErrors, best_fit, best_fit_of_part};
use scene::Scene;

/// The state of a bake: the mesh with this irradiance, and the unshot radiosity of the shares interpolated.
pub fn preview(
    scene: &Scene,
    mesh: &Mesh,
    shares: &[Share],
    (irradiance, direct): (&[DVec3], &[DVec3]),
    unshot: &[DVec3],
    part: LightPart,
) -> LitMesh {
    let revealed = RevealedErrors::new(mesh, irradiance);
    let (lit, _) = lit_mesh(scene, mesh, part, (irradiance, &revealed), direct);
    add_sealed(scene, LitMesh { unshot: at_vertices(mesh, shares, unshot), ..lit })
}

/// A part of the light on a mesh, from the irradiance at its vertices, what was revealed of that, and the direct part of it; and the
/// fitted values of all light.
pub fn lit_mesh(
    scene: &Scene,
    mesh: &Mesh,
    part: LightPart,
    (irradiance, revealed): (&[DVec3], &RevealedErrors),
    direct: &[DVec3],
) -> (LitMesh, Vec<DVec3>) {
    let shown = (!part.is_all())
        .then(|| best_fit_of_part(mesh, irradiance, revealed, &part.of_all(irradiance, direct)));
    let fitted = best_fit(mesh, irradiance, revealed);
    let triangles = triangulate(mesh, scene.surfaces.len(), |vertex: VertexId| fitted[vertex.index()]);
    let lit = with_vertices(mesh, shown.as_deref().unwrap_or(&fitted), triangles);
    (lit, fitted)
}

fn with_vertices(mesh: &Mesh, irradiance: &[DVec3], surfaces: Vec<Vec<LitTriangle>>) -> LitMesh {
    let vertices = mesh
        .vertices
        .iter()
        .zip(irradiance)
        .map(|(vertex, irradiance)| LitVertex {
            position: vertex.position,
            normal: vertex.normal,
            irradiance: *irradiance,
        })
        .collect();
    LitMesh { vertices, surfaces, ..LitMesh::default() }
}

/// Values of shares at all vertices: at those of the shooting mesh the mean of the shares that meet there, by area, and
/// interpolated where patches were divided since.
fn at_vertices(mesh: &Mesh, shares: &[Share], of_shares: &[DVec3]) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0.0); mesh.vertices.len()];
    for (share, value) in shares.iter().zip(of_shares) {
        let own = share.corners.iter().map(|(patch, corner)| mesh.patch(*patch).corners[*corner]);
        let covered = share.overlaps.iter().flat_map(|(patch, _)| mesh.patch(*patch).corners.iter().copied());
        let vertices: Vec<VertexId> = own.chain(covered).collect();
        let area = share.area / vertices.len() as f64;
        for vertex in vertices {
            let (sum, weight) = &mut sums[vertex.index()];
            *sum += *value * area;
            *weight += area;
        }
    }
    let mut values: Vec<Option<DVec3>> =
        sums.into_iter().map(|(sum, weight)| (weight > 0.0).then(|| sum / weight)).collect();
    // A patch comes before its children.
    for patch in &mesh.patches {
        let Some(first) = patch.first_child else { continue };
        let of = |values: &[Option<DVec3>], vertex: VertexId| values[vertex.index()].unwrap_or_default();
        let mean = |values: &[Option<DVec3>], of_corners: &[VertexId]| {
            of_corners.iter().map(|corner| of(values, *corner)).sum::<DVec3>() / of_corners.len() as f64
        };
        for (index, corner) in patch.corners.iter().enumerate() {
            let next = patch.corners[(index + 1) % patch.corners.len()];
            if let Some(middle) = mesh.middle_of(*corner, next) {
                let value = mean(&values, &[*corner, next]);
                values[middle.index()].get_or_insert(value);
            }
        }
        // Each child has the centre opposite to its parent's corner.
        let centre = mesh.patch(first).corners[2];
        let value = mean(&values, &patch.corners);
        values[centre.index()].get_or_insert(value);
    }
    values.into_iter().map(Option::unwrap_or_default).collect()
}
