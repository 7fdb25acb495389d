//! The mesh of the shares, and the row strategy that suits it.

use super::occluders::occluders;
use crate::context::extent;
use crate::mesh::{Contact, Mesh, MeshLimits, divide_buried, shadow_lines};
use crate::rows::{
    ExactRows, GatherRows, RowSource, exact_rows_cost_less, most_vertices_of_exact_rows, row_source,
};
use crate::settings::BakeSettings;
use scene::Scene;

/// Edges longer than the scene divide nothing: diagonals are.
const COARSEST: f64 = 2.0;

/// A mesh of more pieces than this for each vertex that it may have has too many vertices: those of a closed mesh of triangles have two.
const PIECES_PER_VERTEX: usize = 4;

/// The longest contacts that are tried where a mesh without division has too many vertices with all of them.
const MOST_CONTACTS: usize = 8192;

/// The mesh of the shares.
pub struct ShootingMesh {
    /// Where it would have too many vertices, the finest that has not; the scene's own vertices it has in any case.
    pub mesh: Mesh,
    /// Longest edge of its patches, in frame units.
    pub longest_edge: f64,
    /// Makes the rows.
    pub(crate) source: Box<dyn RowSource>,
}

impl ShootingMesh {
    /// The mesh for the strategy of the settings, or for the one that costs less.
    pub fn new(scene: &Scene, settings: &BakeSettings) -> Self {
        let cutter = Cutter {
            scene,
            settings,
            extent: extent(scene),
            lines: shadow_lines(scene, extent(scene), settings.asked_error()),
        };
        let source = row_source(settings.rows).unwrap_or_else(|| cutter.cheapest());
        let (mut mesh, edge) = cutter.finest(settings.shooter_edge * source.edge_factor());
        let longest_edge = edge * cutter.extent;
        let shortest_edge = settings.shortest_edge(cutter.extent);
        divide_buried(&mut mesh, scene, longest_edge, shortest_edge, settings.most_vertices(scene));
        Self { mesh, longest_edge, source }
    }

    /// The same mesh for other settings, which name a strategy.
    pub fn again(mesh: Mesh, longest_edge: f64, settings: &BakeSettings) -> Option<Self> {
        row_source(settings.rows).map(|source| Self { mesh, longest_edge, source })
    }
}

/// Cuts a scene into patches.
struct Cutter<'a> {
    scene: &'a Scene,
    settings: &'a BakeSettings,
    extent: f64,
    /// Shadow lines by surface and facet.
    lines: Vec<Vec<Vec<Contact>>>,
}

impl Cutter<'_> {
    /// The rows that cost less on their mesh.
    fn cheapest(&self) -> Box<dyn RowSource> {
        let most = most_vertices_of_exact_rows(self.settings);
        // A closed mesh of triangles has half as many vertices.
        let is_small = self.scene.front_facets().nth(2 * most).is_none();
        let mesh = is_small.then(|| self.within(self.settings.shooter_edge * ExactRows.edge_factor(), most));
        let is_exact = mesh.flatten().is_some_and(|mesh| {
            let occluders = occluders(self.scene).polygons;
            let patches: Vec<_> = mesh.leaves().map(|(id, _)| mesh.polygon(self.scene, id)).collect();
            exact_rows_cost_less(self.settings, mesh.vertices.len(), &occluders, &patches)
        });
        if is_exact { Box::new(ExactRows) } else { Box::new(GatherRows::default()) }
    }

    /// The mesh with edges up to this part of the extent, if it has at most this number of vertices.
    fn within(&self, edge: f64, most: usize) -> Option<Mesh> {
        let limits = MeshLimits { pieces: PIECES_PER_VERTEX.saturating_mul(most), ..MeshLimits::NONE };
        self.cut(edge, limits).filter(|mesh| mesh.vertices.len() <= most)
    }

    fn cut(&self, edge: f64, limits: MeshLimits) -> Option<Mesh> {
        let longest_edge = edge * self.extent;
        Mesh::within(limits, self.scene, self.extent, longest_edge, self.settings.max_level, &self.lines)
    }

    /// The mesh with edges up to this part of the extent or, where that has too many vertices, the finest that has not. With its edge.
    fn finest(&self, mut edge: f64) -> (Mesh, f64) {
        let most = self.settings.most_vertices(self.scene);
        if self.scene.vertex_count - self.scene.sealed_vertex_count >= most {
            edge = edge.max(COARSEST);
        }
        loop {
            if let Some(mesh) = self.within(edge, most) {
                return (mesh, edge);
            }
            if edge >= COARSEST {
                break;
            }
            edge = (2.0 * edge).min(COARSEST);
        }
        // Its contacts alone are too many.
        let pieces = PIECES_PER_VERTEX.saturating_mul(most);
        for contacts in [1, 4, 16, 64].map(|part| MOST_CONTACTS / part) {
            let mesh = self.cut(edge, MeshLimits { pieces, contacts });
            if let Some(mesh) = mesh.filter(|mesh| mesh.vertices.len() <= most) {
                return (mesh, edge);
            }
        }
        let coarsest = MeshLimits { contacts: 0, ..MeshLimits::NONE };
        (self.cut(edge, coarsest).unwrap_or_default(), edge)
    }
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
        let ShootingMesh { mesh, longest_edge, .. } = ShootingMesh::new(&scene, &settings);
        assert!(mesh.vertices.len() <= 6000, "{} vertices", mesh.vertices.len());
        let limits = MeshLimits { contacts: 0, ..MeshLimits::NONE };
        let without =
            Mesh::within(limits, &scene, extent(&scene), longest_edge, settings.max_level, &[]).unwrap();
        assert!(mesh.vertices.len() > without.vertices.len(), "no contact is left");
    }
}
