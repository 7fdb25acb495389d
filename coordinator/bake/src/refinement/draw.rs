//! Points drawn at random on leaves.

use std::ops::Range;

use glam::DVec3;
use kernel::geometry::uniform_point;
use kernel::replica::Receiver;
use sobol_burley::sample_4d;

use crate::mesh::{INWARD, Mesh, PatchId, VertexId, along_curve, interpolation};
use scene::Scene;

/// Number of points at the front that are a random part of all.
pub const FIRST: usize = 256;

/// Length of the sequence that points are drawn from.
pub const MOST_DRAWN: usize = 1 << 16;

/// Scenes with many patches get one point for this many of them.
const PATCHES_PER_POINT: usize = 16;

/// Most points, unless more were asked for.
const MOST_POINTS: usize = 2048;

/// Positions where light is gathered twice, where few would be enough for light gathered once, relative to these: hot spots are too
/// small for few.
const POSITIONS_TWICE: usize = 4;

/// Which points to draw.
#[derive(Debug, Clone, Copy, Default)]
pub struct Draw {
    /// Each round draws points of its own.
    pub round: u32,
    /// Whether light is gathered twice at each position, of which there are more then.
    pub is_twice: bool,
    /// Positions drawn before in this round: as many more are drawn.
    pub positions_before: usize,
}

impl Draw {
    /// Number of positions on this number of patches, where points were asked for, `least` of them or more.
    pub fn positions(&self, least: usize, patches: usize) -> usize {
        let most = if self.is_twice { MOST_DRAWN / 2 } else { MOST_DRAWN };
        let positions = match (least, self.positions_before) {
            (0, _) => 0,
            (_, 0) => {
                let once = least.max(patches / PATCHES_PER_POINT).min(MOST_POINTS.max(least));
                if self.is_twice { (once * POSITIONS_TWICE).min(MOST_POINTS.max(once)) } else { once }
            }
            (_, before) => before,
        };
        positions.min(most - self.positions_before)
    }
}

/// A point on the surface.
#[derive(Debug, Clone, PartialEq)]
pub struct SamplePoint {
    /// Its patch, a leaf when the point was drawn.
    pub patch: PatchId,
    pub reflectance: DVec3,
    pub receiver: Receiver,
    /// On the surface, where the receiver may be lifted off it.
    pub position: DVec3,
    /// Density of the area over the sampling density.
    pub weight: f64,
}

/// Draws points on these leaves, by a `seed` and a round: those of their sequence at these places.
pub fn draw_on(
    mesh: &Mesh,
    scene: &Scene,
    leaves: &[PatchId],
    expected: &[f64],
    (seed, round): (u64, u32),
    places: Range<usize>,
) -> Vec<SamplePoint> {
    if leaves.is_empty() {
        return vec![];
    }
    let area: f64 = leaves.iter().map(|id| mesh.patch(*id).area).sum();
    let all_errors: f64 = expected.iter().sum();
    // Leaves with the end of their part of the unit interval, and the weight of a point on them.
    let mut end = 0.0;
    let parts: Vec<(PatchId, f64, f64)> = leaves
        .iter()
        .enumerate()
        .map(|(index, id)| {
            let by_area = mesh.patch(*id).area / area;
            let by_error = if all_errors > 0.0 { expected[index] / all_errors } else { by_area };
            let part = (by_area + by_error) / 2.0;
            end += part;
            (*id, end, by_area / part)
        })
        .collect();
    let seed = ((seed ^ (seed >> 32)) as u32).wrapping_add(round.wrapping_mul(0x9e37_79b9));
    let point = |index: usize| {
        let [x, y, z, _] = sample_4d(index as u32, 0, seed).map(f64::from);
        let place = parts.partition_point(|(_, part_end, _)| *part_end <= x * end).min(parts.len() - 1);
        let (id, _, weight) = parts[place];
        point_on(mesh, scene, id, [y, z], weight)
    };
    let mut points: Vec<SamplePoint> = places.map(point).collect();
    // The first of them are used alone: they stay a random part of all. Rows over neighbours cost least.
    let first = FIRST.min(points.len());
    let (first, others) = points.split_at_mut(first);
    for part in [first, others] {
        part.sort_by_cached_key(|point| along_curve(point.position));
    }
    points
}

/// The point of a leaf at a place in the unit square.
fn point_on(mesh: &Mesh, scene: &Scene, id: PatchId, [y, z]: [f64; 2], weight: f64) -> SamplePoint {
    point_at(mesh, scene, id, uniform_point(&mesh.corners(id), y, z), weight)
}

/// A point of a leaf.
pub fn point_at(mesh: &Mesh, scene: &Scene, id: PatchId, position: DVec3, weight: f64) -> SamplePoint {
    let normals = interpolation(mesh, id, position, |_| DVec3::ZERO);
    let vertex = |id: VertexId| &mesh.vertices[id.index()];
    let normal: DVec3 = normals.iter().map(|(id, weight)| vertex(*id).normal * *weight).sum();
    let patch = mesh.patch(id);
    let surface = &scene.surfaces[patch.surface as usize];
    let facet = &surface.facets[patch.facet as usize];
    let normal = normal.normalize_or(facet.normal);
    // As for vertices: facets around a smooth point may rise over its horizon.
    let is_smooth = normals.iter().any(|(id, _)| vertex(*id).smooth);
    let lift = if is_smooth { INWARD * patch.area.sqrt() } else { 0.0 };
    SamplePoint {
        patch: id,
        reflectance: surface.mean_reflectance(patch.facet, &[position]),
        receiver: Receiver { position: position + normal * lift, normal, plane: facet.plane },
        position,
        weight,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_positions_are_drawn_again_until_the_sequence_ends() {
        let draw = |is_twice, positions_before| Draw { round: 3, is_twice, positions_before };
        // As many as were asked for, or one for each 16 patches; four times as many where light is gathered twice.
        assert_eq!(draw(false, 0).positions(256, 100), 256);
        assert_eq!(draw(false, 0).positions(256, 16_000), 1000);
        assert_eq!(draw(true, 0).positions(256, 100), 1024);
        assert_eq!(draw(true, 0).positions(256, 1 << 20), MOST_POINTS);
        assert_eq!(draw(true, 1024).positions(256, 100), 1024);
        assert_eq!(draw(true, MOST_DRAWN / 2 - 5).positions(256, 100), 5);
        assert_eq!(draw(false, 0).positions(MOST_DRAWN + 1, 100), MOST_DRAWN);
        for before in [0, 1024] {
            assert_eq!(draw(true, before).positions(0, 100), 0);
        }
    }
}
