//! The shooting mesh, its shares and the light sources.

use glam::DVec3;

use super::light::{self, LightSource};
use crate::context::{Context, extent};
use crate::error::{BakeError, Result};
use crate::mesh::{Mesh, MeshLimits, PatchId, shadow_lines};
use crate::refinement::SamplePoints;
use crate::rows::{Rows, ShareMesh, row_source};
use crate::settings::BakeSettings;
use scene::Scene;

/// Edges longer than the scene divide nothing: diagonals are.
const COARSEST: f64 = 2.0;

/// A mesh of more pieces than this for each vertex that it may have has too many vertices: those of a closed mesh of triangles have two.
const PIECES_PER_VERTEX: usize = 4;

/// The longest contacts that are tried where a mesh without division has too many vertices with all of them.
const MOST_CONTACTS: usize = 8192;

/// Longest edge of the smallest leaves whose middles are looked at, relative to that of the largest.
const LEAST_MIDDLE: f64 = 0.125;

/// Key of the first middle of a leaf as a receiver, above those of all samples and gather points.
const FIRST_MIDDLE: u64 = 1 << 38;

/// A bake before any light.
pub struct Setup {
    pub mesh: ShareMesh,
    pub rows: Rows,
    pub sources: Vec<LightSource>,
    /// Points that guide refinement.
    pub samples: SamplePoints,
    /// Middles of large leaves.
    pub middles: SamplePoints,
}

impl Setup {
    /// Deals a shooting mesh out among shares, and publishes its vertices as receivers. The mesh comes with the longest edge of its
    /// patches in frame units.
    pub fn new(cx: &mut Context, (mesh, longest_edge): (Mesh, f64)) -> Result<Self> {
        cx.client.monitor.check()?;
        cx.client.monitor.set_error(None);
        let (scene, settings) = (cx.scene, cx.settings);
        if mesh.patches.is_empty() {
            return Err(BakeError::EmptyMesh);
        }
        let mut source = row_source(scene, settings);
        let shares = source.shares(cx, &mesh, longest_edge);
        let mesh = ShareMesh::new(scene, mesh, shares);
        let first_key = mesh.shares.len() as u64;
        let sources = light::sources(scene, &mesh.mesh, settings, first_key, source.joins_sources());
        let table = source.open(cx, &mesh);
        let mut rows = Rows { source, table };
        rows.add_coarse(cx, &mesh.mesh)?;
        let samples = SamplePoints::draw(&mesh.mesh, scene, settings, &[], (0, false));
        let middles = if rows.source.leaves_cost_rows() {
            SamplePoints::default()
        } else {
            let least = LEAST_MIDDLE * longest_edge;
            let reflects =
                |id: PatchId| scene.surfaces[mesh.mesh.patch(id).surface as usize].reflectance != DVec3::ZERO;
            let leaves = mesh.mesh.leaves().map(|(id, _)| id);
            let leaves: Vec<PatchId> =
                leaves.filter(|id| mesh.mesh.size(*id) > least && reflects(*id)).collect();
            SamplePoints::middles(&mesh.mesh, scene, &leaves, FIRST_MIDDLE)
        };
        cx.end_step("mesh");
        Ok(Self { mesh, rows, sources, samples, middles })
    }
}

/// The mesh of the shares, with the longest edge of its patches in frame units. Where it would have too many vertices, the finest
/// that has not; the scene's own vertices it has in any case.
pub fn shooting_mesh(scene: &Scene, settings: &BakeSettings) -> (Mesh, f64) {
    let extent = extent(scene);
    let most = settings.most_vertices(scene);
    let mut edge = settings.shooter_edge * row_source(scene, settings).edge_factor();
    if scene.vertex_count - scene.sealed_vertex_count >= most {
        edge = edge.max(COARSEST);
    }
    let lines = shadow_lines(scene, extent, settings.asked_error());
    let limits = MeshLimits { pieces: PIECES_PER_VERTEX.saturating_mul(most), ..MeshLimits::NONE };
    let mesh =
        |edge: f64, limits| Mesh::within(limits, scene, extent, edge * extent, settings.max_level, &lines);
    let is_small = |mesh: &Mesh| mesh.vertices.len() <= most;
    loop {
        if let Some(mesh) = mesh(edge, limits).filter(is_small) {
            return (mesh, edge * extent);
        }
        if edge >= COARSEST {
            break;
        }
        edge = (2.0 * edge).min(COARSEST);
    }
    // Its contacts alone are too many.
    for contacts in [1, 4, 16, 64].map(|part| MOST_CONTACTS / part) {
        if let Some(mesh) = mesh(edge, MeshLimits { contacts, ..limits }).filter(is_small) {
            return (mesh, edge * extent);
        }
    }
    let coarsest = MeshLimits { contacts: 0, ..MeshLimits::NONE };
    (mesh(edge, coarsest).unwrap_or_default(), edge * extent)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{facet, scene};

    /// Contact lines of triangles that all pass through each other would alone be more than a mesh may have.
    #[test]
    fn contacts_do_not_give_a_mesh_more_vertices_than_it_may_have() {
        let triangles = 600;
        // A fixed sequence that fills a cube evenly.
        let coordinate = |index: usize| (index as f64 * 0.754_877_666_246_693).fract() * 1024.0;
        let corner = |index: usize| [0, 1, 2].map(|axis| coordinate(3 * index + axis + 1 + index * index));
        let facets =
            (0..triangles).map(|index| facet(index as u32, &[0, 1, 2].map(|at| corner(3 * index + at))));
        let scene = scene(vec![facets.collect()], vec![]);
        let settings = BakeSettings { max_vertices: Some(6000), ..BakeSettings::default() };
        let (mesh, longest_edge) = shooting_mesh(&scene, &settings);
        assert!(mesh.vertices.len() <= 6000, "{} vertices", mesh.vertices.len());
        let limits = MeshLimits { contacts: 0, ..MeshLimits::NONE };
        let without =
            Mesh::within(limits, &scene, extent(&scene), longest_edge, settings.max_level, &[]).unwrap();
        assert!(mesh.vertices.len() > without.vertices.len(), "no contact is left");
    }
}
