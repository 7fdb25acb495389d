//! What viewers show where touching surfaces cover each other, and on the insides of closed bodies.
//!
//! The end of a beam that stands against another is dark, and nobody sees it; but a rasterizer rounds, and shows dots of it all along
//! the edge that it shares with the lit sides. So do the insides of bodies whose materials are double sided. Vertices of such
//! darkness are therefore shown as bright as what lies beside them.

use foldhash::{HashMap, HashMapExt};
use glam::DVec3;
use kernel::hierarchy::{Hierarchy, PaddedBox};
use rayon::prelude::*;

use super::grid::{ON_EDGE, bits};
use crate::context::extent;
use crate::lit::{LitMesh, LitTriangle};
use scene::{Facet, Scene, Side};

/// Part of the way from each corner of a triangle to its middle at which something must cover it.
const INWARDS: f64 = 0.25;

/// Part of the mean irradiance of all vertices up to which a vertex is dark: touching surfaces get a little from what is near.
const DARK: f64 = 1e-3;

/// A position's light: a sum, and of how many vertices.
type Beside = HashMap<[u64; 3], (DVec3, u32)>;

/// A dark triangle of a front, by the numbers of its surface and of the facet within it.
struct Cover<'a> {
    surface: usize,
    number: u32,
    facet: &'a Facet,
    corners: [DVec3; 3],
}

/// The covered vertices at whose positions others are lit, in order, with the mean irradiance of these.
pub fn covered(scene: &Scene, lit: &LitMesh) -> Vec<(u32, DVec3)> {
    let brightness = |vertex: u32| lit.vertices[vertex as usize].irradiance.max_element();
    let all = 0..lit.vertices.len() as u32;
    let sum: f64 = all.clone().map(brightness).sum();
    let dark = DARK * sum / lit.vertices.len().max(1) as f64;
    let is_dark = |vertex: u32| brightness(vertex) <= dark;
    // Of both zeros one.
    let key = |vertex: u32| bits(lit.vertices[vertex as usize].position + DVec3::ZERO);
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
    if beside.is_empty() {
        return vec![];
    }
    let is_beside_light = |vertex: u32| is_dark(vertex) && beside.contains_key(&key(vertex));
    let mut is_covered = vec![true; lit.vertices.len()];
    for vertex in uncovered(scene, lit, is_dark, is_beside_light) {
        is_covered[vertex as usize] = false;
    }
    let light = |vertex: u32| beside.get(&key(vertex)).map(|(sum, count)| (vertex, *sum / f64::from(*count)));
    all.filter(|vertex| is_covered[*vertex as usize] && is_dark(*vertex)).filter_map(light).collect()
}

/// The vertices of triangles that are not covered everywhere, of those with a vertex that is asked about.
///
/// What covers is dark itself: of two rooms whose walls stand back to back, one may be lit and the other not.
fn uncovered(
    scene: &Scene,
    lit: &LitMesh,
    is_dark: impl Fn(u32) -> bool + Sync,
    is_asked: impl Fn(u32) -> bool + Sync,
) -> Vec<u32> {
    let near = ON_EDGE * extent(scene);
    let position = |vertex: u32| lit.vertices[vertex as usize].position;
    let all = lit.surfaces.par_iter().enumerate();
    let all = all.flat_map_iter(|(surface, own)| own.iter().map(move |triangle| (surface, triangle)));
    let dark: Vec<(usize, &LitTriangle)> =
        all.filter(|(_, triangle)| triangle.vertices.iter().any(|vertex| is_dark(*vertex))).collect();
    let covers = dark.iter().filter(|(surface, triangle)| {
        let is_front = scene.surfaces[*surface].side == Side::Front;
        is_front && triangle.vertices.iter().all(|vertex| is_dark(*vertex))
    });
    let covers = covers.map(|(surface, triangle)| Cover {
        surface: *surface,
        number: triangle.facet,
        facet: &scene.surfaces[*surface].facets[triangle.facet as usize],
        corners: triangle.vertices.map(position),
    });
    let tree = Hierarchy::new(covers.collect(), |cover: &Cover| PaddedBox::around(cover.corners, near));
    let is_covered = |surface: usize, triangle: &LitTriangle| {
        let facet = &scene.surfaces[surface].facets[triangle.facet as usize];
        if facet.is_sealed {
            return true;
        }
        // The other side of a sheet does not cover it.
        let front = surface - usize::from(scene.surfaces[surface].side == Side::Back);
        let covers = |cover: &Cover, point: DVec3| {
            (cover.surface, cover.number) != (front, triangle.facet)
                && cover.facet.plane == facet.plane
                && cover.facet.normal.dot(facet.normal) < 0.0
                && cover.holds(point, near)
        };
        let corners = triangle.vertices.map(position);
        let middle = corners.iter().sum::<DVec3>() / 3.0;
        corners.iter().all(|corner| {
            let point = corner.lerp(middle, INWARDS);
            tree.touching(&PaddedBox::around([point], near)).iter().any(|cover| covers(cover, point))
        })
    };
    let is_open = |(surface, triangle): &&(usize, &LitTriangle)| {
        triangle.vertices.iter().any(|vertex| is_asked(*vertex)) && !is_covered(*surface, triangle)
    };
    let open = dark.par_iter().with_min_len(256).filter(is_open);
    open.flat_map_iter(|(_, triangle)| triangle.vertices).collect()
}

impl Cover<'_> {
    /// Whether a point of its plane lies in it, but for `near`.
    fn holds(&self, point: DVec3, near: f64) -> bool {
        (0..3).all(|index| {
            let (from, to) = (self.corners[index], self.corners[(index + 1) % 3]);
            self.facet.normal.dot((to - from).normalize_or_zero().cross(point - from)) >= -near
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lit::LitVertex;
    use crate::test_scenes::{facet, scene};

    /// The ends of two boxes, `gap` apart, and a lit side at the upper edge of the first.
    fn ends(gap: f64) -> (Scene, LitMesh) {
        let first = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]];
        let mut other = first.map(|[_, y, z]| [gap, y, z]);
        other.reverse();
        let side = [[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [-1.0, 0.0, 1.0]];
        let shapes = [first.to_vec(), other.to_vec(), side.to_vec()];
        let facets = [0, u32::from(gap > 0.0), 2].into_iter().zip(&shapes);
        let scene = scene(facets.map(|(plane, corners)| vec![facet(plane, corners)]).collect(), vec![]);
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

    /// Half of the first end looks out, so that light in its corners would be seen.
    #[test]
    fn what_is_partly_covered_stays_dark() {
        let (scene, mut lit) = ends(0.0);
        for vertex in &mut lit.vertices[4..8] {
            vertex.position.y = vertex.position.y.min(0.5);
        }
        let shown: Vec<u32> = covered(&scene, &lit).iter().map(|(vertex, _)| *vertex).collect();
        assert!(!shown.contains(&2) && !shown.contains(&3), "{shown:?}");
    }

    /// Two rooms whose walls stand back to back.
    #[test]
    fn what_is_lit_covers_nothing() {
        let (scene, mut lit) = ends(0.0);
        lit.vertices[4..8].iter_mut().for_each(|vertex| vertex.irradiance = DVec3::ONE);
        assert_eq!(covered(&scene, &lit), []);
    }

    #[test]
    fn the_inside_of_a_closed_body_is_shown_as_its_outside() {
        let (mut scene, lit) = ends(0.1);
        scene.surfaces[0].facets[0].is_sealed = true;
        let shown: Vec<u32> = covered(&scene, &lit).iter().map(|(vertex, _)| *vertex).collect();
        assert_eq!(shown, [2, 3]);
    }

    #[test]
    fn a_sheet_does_not_cover_itself() {
        let (mut scene, lit) = ends(0.0);
        scene.surfaces[1].side = Side::Back;
        assert_eq!(covered(&scene, &lit), []);
    }
}
