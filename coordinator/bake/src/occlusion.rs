//! Ambient occlusion of a lit mesh: how much of what its vertices see is near.

use glam::DVec3;
use kernel::geometry::area_vector;
use kernel::hemisphere::{SeenPolygons, directions};
use rayon::prelude::*;

use crate::lit::{LitMesh, LitTriangle};
use scene::{Facet, Scene};

/// Rays of a vertex.
const RAYS: u32 = 256;

/// A ray that transparent surfaces leave less than this fraction is not followed any further.
const LEAST_LEFT: f64 = 1e-3;

/// How far from a vertex its rays start, towards the middle of a triangle of it: on the border of two walls they would start in both.
const INWARD: f64 = 1e-2;

/// Vertices between two questions whether to stop.
const AT_ONCE: usize = 1 << 12;

/// Of each vertex of a lit mesh, the part of its hemisphere, weighted by the cosine, in which nothing stands within a distance, in units
/// of the file. `None` if `is_cancelled` says so, which is asked often.
pub fn occlusion(
    scene: &Scene,
    lit: &LitMesh,
    distance: f64,
    mut is_cancelled: impl FnMut() -> bool,
) -> Option<Vec<f64>> {
    let surroundings = Surroundings::new(scene, lit, distance / scene.frame.scale);
    let owners = largest_triangles(lit);
    let mut open = Vec::with_capacity(owners.len());
    for (some, first) in owners.chunks(AT_ONCE).zip((0..).step_by(AT_ONCE)) {
        if is_cancelled() {
            return None;
        }
        let at = |(index, owner): (usize, &Option<Owner>)| {
            owner.map_or(1.0, |owner| surroundings.open_part(first + index, owner))
        };
        open.par_extend(some.par_iter().enumerate().with_min_len(16).map(at));
    }
    Some(open)
}

/// A triangle of a surface that has a vertex.
#[derive(Clone, Copy)]
struct Owner {
    surface: usize,
    triangle: LitTriangle,
}

/// The largest triangle of each vertex; of several the first.
fn largest_triangles(lit: &LitMesh) -> Vec<Option<Owner>> {
    let mut owners: Vec<Option<Owner>> = vec![None; lit.vertices.len()];
    let mut areas = vec![0.0; lit.vertices.len()];
    for (surface, triangles) in lit.surfaces.iter().enumerate() {
        for triangle in triangles {
            let corners = triangle.vertices.map(|vertex| lit.vertices[vertex as usize].position);
            let area = area_vector(&corners).length();
            for vertex in triangle.vertices {
                if area > areas[vertex as usize] {
                    areas[vertex as usize] = area;
                    owners[vertex as usize] = Some(Owner { surface, triangle: *triangle });
                }
            }
        }
    }
    owners
}

/// What stands around the vertices of a lit mesh.
struct Surroundings<'a> {
    scene: &'a Scene,
    lit: &'a LitMesh,
    seen: SeenPolygons,
    /// Frame units.
    distance: f64,
}

impl<'a> Surroundings<'a> {
    fn new(scene: &'a Scene, lit: &'a LitMesh, distance: f64) -> Self {
        // Facets block light from both sides.
        let facets: Vec<_> = scene
            .fronts()
            .flat_map(|own| own.facets.iter().enumerate().map(move |facet| (own, facet)))
            .collect();
        let polygons: Vec<_> = facets.iter().map(|(_, (_, facet))| facet.polygon()).collect();
        let mut opacities: Vec<f32> = facets
            .par_iter()
            .map(|(surface, (index, facet))| {
                let corners: Vec<DVec3> = facet.positions().collect();
                surface.mean_opacity(*index as u32, &corners).clamp(0.0, 1.0) as f32
            })
            .collect();
        if opacities.iter().all(|opacity| *opacity == 1.0) {
            opacities.clear();
        }
        Self { scene, lit, seen: SeenPolygons::new(&polygons, &opacities), distance }
    }

    /// The open part of a vertex's hemisphere.
    fn open_part(&self, vertex: usize, Owner { surface, triangle }: Owner) -> f64 {
        let facet: &Facet = &self.scene.surfaces[surface].facets[triangle.facet as usize];
        let corners = triangle.vertices.map(|corner| self.lit.vertices[corner as usize].position);
        let middle = corners.iter().sum::<DVec3>() / 3.0;
        let origin = self.lit.vertices[vertex].position.lerp(middle, INWARD);
        let (mut all, mut open) = (0, 0.0);
        // Of a seed for each vertex: even light would show the same error everywhere, as bands.
        for (_, direction) in directions(self.lit.vertices[vertex].normal, RAYS, vertex as u32) {
            // Below a flat piece of a curved surface there is nothing to see.
            if direction.dot(facet.normal) > 0.0 {
                all += 1;
                open += self.left(origin, direction, facet);
            }
        }
        if all == 0 { 1.0 } else { open / f64::from(all) }
    }

    /// The part of a ray that comes as far as the distance.
    fn left(&self, origin: DVec3, direction: DVec3, own: &Facet) -> f64 {
        let (mut left, mut from) = (1.0, 0.0);
        while left > LEAST_LEFT {
            let hit = self.seen.nearest(origin, direction, from, own.plane);
            let Some(hit) = hit.filter(|hit| hit.distance < self.distance) else { break };
            left *= 1.0 - self.seen.opacity(hit.polygon);
            from = hit.distance;
        }
        left
    }
}
