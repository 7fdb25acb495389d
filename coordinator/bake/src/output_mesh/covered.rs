//! What viewers show where touching surfaces cover each other.
//!
//! The end of a beam that stands against another is dark, and nobody sees it; but a rasterizer rounds, and shows dots of it all along
//! the edge that it shares with the lit sides. Vertices of such darkness are therefore shown as bright as what lies beside them.

use foldhash::{HashMap, HashMapExt};
use glam::DVec3;
use kernel::hierarchy::{Hierarchy, PaddedBox};
use rayon::prelude::*;

use super::grid::{ON_EDGE, bits};
use crate::context::extent;
use crate::lit::{LitMesh, LitTriangle};
use scene::{Facet, Scene, Side};

/// How far from a corner towards the middle of its triangle it is looked whether something covers it.
const INWARDS: f64 = 0.25;

/// Largest cosine between the normals of two facets that cover each other.
const FACING: f64 = -0.9999;

/// A position's light: a sum, and of how many vertices.
type Beside = HashMap<[u64; 3], (DVec3, u32)>;

/// A front, by the numbers of its surface and of the facet within it.
struct Front<'a> {
    surface: usize,
    number: u32,
    facet: &'a Facet,
}

/// The covered vertices at whose positions others are lit, in order, with the mean irradiance of these.
pub fn covered(scene: &Scene, lit: &LitMesh) -> Vec<(u32, DVec3)> {
    let is_dark = |vertex: u32| lit.vertices[vertex as usize].irradiance == DVec3::ZERO;
    let key = |vertex: u32| bits(lit.vertices[vertex as usize].position);
    let all = 0..lit.vertices.len() as u32;
    let mut beside: Beside = HashMap::new();
    beside
        .extend(all.clone().filter(|vertex| is_dark(*vertex)).map(|vertex| (key(vertex), (DVec3::ZERO, 0))));
    if beside.is_empty() {
        return vec![];
    }
    for vertex in all.clone().filter(|vertex| !is_dark(*vertex)) {
        if let Some((sum, count)) = beside.get_mut(&key(vertex)) {
            *sum += lit.vertices[vertex as usize].irradiance;
            *count += 1;
        }
    }
    beside.retain(|_, (_, count)| *count > 0);
    let is_beside_light = |vertex: u32| is_dark(vertex) && beside.contains_key(&key(vertex));
    let mut is_covered = vec![true; lit.vertices.len()];
    for vertex in uncovered(scene, lit, is_beside_light) {
        is_covered[vertex as usize] = false;
    }
    let light = |vertex: u32| beside.get(&key(vertex)).map(|(sum, count)| (vertex, *sum / f64::from(*count)));
    all.filter(|vertex| is_covered[*vertex as usize] && is_dark(*vertex)).filter_map(light).collect()
}

/// Vertices, of those that are asked about, with a triangle that nothing covers.
fn uncovered(scene: &Scene, lit: &LitMesh, is_asked: impl Fn(u32) -> bool + Sync) -> Vec<u32> {
    let near = ON_EDGE * extent(scene);
    let fronts = scene.surfaces.iter().enumerate().filter(|(_, own)| own.side == Side::Front);
    let fronts = fronts.flat_map(|(surface, own)| {
        (0..).zip(&own.facets).map(move |(number, facet)| Front { surface, number, facet })
    });
    let tree =
        Hierarchy::new(fronts.collect(), |front: &Front| PaddedBox::around(front.facet.positions(), near));
    let is_covered = |surface: usize, triangle: &LitTriangle, corner: u32| {
        let facet = &scene.surfaces[surface].facets[triangle.facet as usize];
        if facet.is_sealed {
            return true;
        }
        let position = |vertex: u32| lit.vertices[vertex as usize].position;
        let middle = triangle.vertices.map(position).iter().sum::<DVec3>() / 3.0;
        let point = position(corner).lerp(middle, INWARDS);
        // The other side of a sheet does not cover it.
        let front = surface - usize::from(scene.surfaces[surface].side == Side::Back);
        let covers = |other: &&Front| {
            (other.surface, other.number) != (front, triangle.facet)
                && other.facet.normal.dot(facet.normal) < FACING
                && holds(other.facet, point, near)
        };
        tree.touching(&PaddedBox::around([point], near)).iter().any(covers)
    };
    let triangles: Vec<(usize, &LitTriangle)> = lit
        .surfaces
        .iter()
        .enumerate()
        .flat_map(|(surface, own)| own.iter().map(move |triangle| (surface, triangle)))
        .collect();
    let of_triangle = |(surface, triangle): &(usize, &LitTriangle)| {
        let asked = triangle.vertices.into_iter().filter(|vertex| is_asked(*vertex));
        asked.filter(|corner| !is_covered(*surface, triangle, *corner)).collect::<Vec<_>>()
    };
    triangles.par_iter().with_min_len(1024).flat_map_iter(of_triangle).collect()
}

/// Whether a point lies in a facet, but for `near`.
fn holds(facet: &Facet, point: DVec3, near: f64) -> bool {
    let corners: Vec<DVec3> = facet.positions().collect();
    let is_inside = |(index, from): (usize, &DVec3)| {
        let to = corners[(index + 1) % corners.len()];
        facet.normal.dot((to - *from).normalize_or_zero().cross(point - *from)) >= -near
    };
    corners.first().is_some_and(|corner| facet.normal.dot(point - *corner).abs() <= near)
        && corners.iter().enumerate().all(is_inside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lit::LitVertex;
    use crate::test_scenes::{facet, scene};

    /// The ends of two boxes, `gap` apart, each with a lit side at its upper edge; the first end has a back of its own.
    fn ends(gap: f64) -> (Scene, LitMesh) {
        let first = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]];
        let mut other = first.map(|[_, y, z]| [gap, y, z]);
        other.reverse();
        let side = [[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [-1.0, 0.0, 1.0]];
        let shapes = [first.to_vec(), other.to_vec(), side.to_vec()];
        let scene = scene(shapes.iter().map(|corners| vec![facet(0, corners)]).collect(), vec![]);
        let mut lit = LitMesh::default();
        for (shape, irradiance) in shapes.iter().zip([DVec3::ZERO, DVec3::ZERO, DVec3::ONE]) {
            let first = lit.vertices.len() as u32;
            lit.vertices.extend(shape.iter().map(|corner| {
                let position = DVec3::from_array(*corner);
                LitVertex { position, normal: DVec3::Z, irradiance }
            }));
            let triangles = [[0, 1, 2], [0, 2, 3]];
            lit.surfaces.push(
                triangles
                    .map(|corners| LitTriangle { facet: 0, vertices: corners.map(|corner| first + corner) })
                    .to_vec(),
            );
        }
        (scene, lit)
    }

    #[test]
    fn ends_that_touch_are_shown_as_what_lies_beside_them() {
        let (scene, lit) = ends(0.0);
        // The upper corners of both ends, where the side is lit.
        let shown: Vec<u32> = covered(&scene, &lit).iter().map(|(vertex, _)| *vertex).collect();
        assert_eq!(shown, [2, 3, 4, 5]);
        assert!(covered(&scene, &lit).iter().all(|(_, light)| *light == DVec3::ONE));
    }

    #[test]
    fn what_is_dark_but_can_be_seen_stays_dark() {
        let (scene, lit) = ends(0.1);
        assert_eq!(covered(&scene, &lit), []);
    }

    /// Half of one end looks out.
    #[test]
    fn what_is_partly_covered_stays_dark_where_it_can_be_seen() {
        let (mut scene, lit) = ends(0.0);
        for corner in &mut scene.surfaces[1].facets[0].corners {
            corner.position.y = corner.position.y.min(0.5);
        }
        let shown: Vec<u32> = covered(&scene, &lit).iter().map(|(vertex, _)| *vertex).collect();
        assert!(shown.contains(&3) && !shown.contains(&2), "{shown:?}");
    }

    #[test]
    fn a_sheet_does_not_cover_itself() {
        let (mut scene, lit) = ends(0.0);
        scene.surfaces[1].side = Side::Back;
        assert_eq!(covered(&scene, &lit), []);
    }
}
