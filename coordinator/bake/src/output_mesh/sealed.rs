//! The dark insides of closed bodies, which the bake leaves out, as the input has them.

use foldhash::{HashMap, HashMapExt, HashSet};
use glam::DVec3;
use rayon::prelude::*;
use smallvec::SmallVec;

use super::grid::{Grid, ON_EDGE, ONE_POINT, bits};
use super::split::{fan, is_line, normal_between};
use crate::context::extent;
use crate::lit::{LitMesh, LitTriangle, LitVertex};
use scene::{Facet, Scene};

/// A triangle of a sealed facet.
struct SealedTriangle<'a> {
    surface: usize,
    /// Number of the facet within the surface.
    facet: u32,
    of: &'a Facet,
    positions: [DVec3; 3],
}

/// Adds the triangles of sealed facets, without light.
pub fn add_sealed(scene: &Scene, lit: LitMesh) -> LitMesh {
    let sealed = sealed_triangles(scene);
    let on_edges = vec![Some(OnEdges::default()); sealed.len()];
    with_triangles(lit, &sealed, on_edges)
}

/// The same, split where vertices lie on their edges, which their lit sides share.
pub fn add_conforming(scene: &Scene, lit: LitMesh) -> LitMesh {
    let sealed = sealed_triangles(scene);
    if sealed.is_empty() {
        return lit;
    }
    let on_edges = on_edges(&sealed, &lit, extent(scene));
    with_triangles(lit, &sealed, on_edges)
}

fn with_triangles(mut lit: LitMesh, sealed: &[SealedTriangle], on_edges: Vec<Option<OnEdges>>) -> LitMesh {
    let mut known: HashMap<(usize, [u64; 3], [u64; 3]), u32> = HashMap::new();
    for (triangle, on_edges) in sealed.iter().zip(on_edges) {
        let Some(on_edges) = on_edges else { continue };
        let mut vertex = |(position, normal)| {
            *known.entry((triangle.surface, bits(position), bits(normal))).or_insert_with(|| {
                lit.vertices.push(LitVertex { position, normal, irradiance: DVec3::ZERO });
                lit.vertices.len() as u32 - 1
            })
        };
        let corners = triangle.positions.map(|position| (position, triangle.normal_at(position)));
        let lines: [SmallVec<[u32; 4]>; 3] = [0, 1, 2].map(|edge| {
            let (from, to) = (corners[edge], corners[(edge + 1) % 3]);
            let is_turned = is_turned([from.0, to.0]);
            let normals = if is_turned { [to.1, from.1] } else { [from.1, to.1] };
            let between = |(position, part): &(DVec3, f64)| (*position, normal_between(normals, *part));
            let mut between: SmallVec<[_; 4]> = on_edges[edge].iter().map(between).collect();
            if is_turned {
                between.reverse();
            }
            [from].into_iter().chain(between).chain([to]).map(&mut vertex).collect()
        });
        let facet = triangle.facet;
        let parts = fan(lines.each_ref().map(SmallVec::as_slice));
        lit.surfaces[triangle.surface]
            .extend(parts.into_iter().map(|vertices| LitTriangle { facet, vertices }));
    }
    let count = lit.vertices.len();
    lit.layers.iter_mut().for_each(|layer| layer.irradiance.resize(count, DVec3::ZERO));
    if !lit.unshot.is_empty() {
        lit.unshot.resize(count, DVec3::ZERO);
    }
    lit
}

/// Whether an edge is looked at from its other end: it is the same for both triangles that share it.
fn is_turned([from, to]: [DVec3; 2]) -> bool {
    to.to_array() < from.to_array()
}

impl SealedTriangle<'_> {
    fn normal_at(&self, position: DVec3) -> DVec3 {
        let corner = self.of.corners.iter().find(|corner| corner.position == position);
        corner.map_or(self.of.normal, |corner| corner.normal)
    }
}

fn sealed_triangles(scene: &Scene) -> Vec<SealedTriangle<'_>> {
    let facets = scene.surfaces.iter().enumerate().flat_map(|(surface, own)| {
        (0..).zip(&own.facets).filter(|(_, of)| of.is_sealed).map(move |(facet, of)| (surface, facet, of))
    });
    facets
        .flat_map(|(surface, facet, of)| {
            let triangle = move |positions| SealedTriangle { surface, facet, of, positions };
            of.positions_of_triangles().into_iter().map(triangle)
        })
        .collect()
}

/// By edge of a triangle: positions of vertices inside the edge, with the part of the way from the end that it is looked at from.
type OnEdges = [Vec<(DVec3, f64)>; 3];

/// What lies on the edges of each triangle; `None` where it is no more than a line.
fn on_edges(sealed: &[SealedTriangle], lit: &LitMesh, extent: f64) -> Vec<Option<OnEdges>> {
    let mut seen = HashSet::default();
    let positions = lit.vertices.iter().map(|vertex| vertex.position);
    let positions = positions.chain(sealed.iter().flat_map(|triangle| triangle.positions));
    let places: Vec<DVec3> = positions.filter(|position| seen.insert(bits(*position))).collect();
    let grid = Grid::new(&places, ON_EDGE * extent);
    let margin = ONE_POINT * extent;
    let of_triangle = |triangle: &SealedTriangle| {
        let [a, b, c] = triangle.positions;
        let mut has_own = false;
        let on_edges = [[a, b, c], [b, c, a], [c, a, b]].map(|[from, to, third]| {
            let ends = if is_turned([from, to]) { [to, from] } else { [from, to] };
            let mut last = 0.0;
            let mut line = vec![];
            for (place, part) in grid.inside(&places, ends, margin) {
                let position = places[place as usize];
                let is_own = position.distance(third) <= margin;
                has_own |= is_own;
                // Vertices of several facets may lie at one place but for a rounding.
                if !is_own && (part - last) * from.distance(to) > margin {
                    line.push((position, part));
                    last = part;
                }
            }
            line
        });
        (!has_own || !is_line(triangle.positions)).then_some(on_edges)
    };
    sealed.par_iter().with_min_len(256).map(of_triangle).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{facet, scene};

    /// Two triangles of a square whose diagonal and one edge have vertices of others in their middles, and one that is a line.
    #[test]
    fn sealed_triangles_are_split_where_vertices_lie_on_their_edges() {
        let triangles = [
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]],
            [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            [[1.0, 0.0, 0.0], [1.0 + 1e-7, 0.5, 0.0], [1.0, 1.0, 0.0]],
        ];
        let facets = triangles.iter().map(|corners| scene::Facet { is_sealed: true, ..facet(0, corners) });
        let scene = scene(vec![facets.collect()], vec![]);
        let vertex =
            |x, y| LitVertex { position: DVec3::new(x, y, 0.0), normal: DVec3::Z, irradiance: DVec3::ONE };
        let lit = || LitMesh {
            vertices: vec![vertex(0.5, 0.5), vertex(1.0, 0.5)],
            surfaces: vec![vec![]],
            ..LitMesh::default()
        };
        assert_eq!(add_sealed(&scene, lit()).surfaces[0].len(), 3);
        let split = add_conforming(&scene, lit());
        assert_eq!(split.surfaces[0].len(), 3 + 2, "{:?}", split.surfaces);
        // The square's corners, the middles of the diagonal and of the edge, and what was there before.
        assert_eq!(split.vertices.len(), 4 + 2 + 2);
        assert!(split.vertices[2..].iter().all(|vertex| vertex.irradiance == DVec3::ZERO));
    }
}
