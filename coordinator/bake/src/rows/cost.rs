//! What the strategies cost on a scene, and so which one it gets.
//!
//! Exact rows look at every pair of a share and a receiver; both follow the number of vertices of the shooting mesh. A pair costs little
//! where its ends look away, and more the more occluders may stand between. Hemisphere rows take rays for each gather point, as many as
//! the error asks for; of those points there are some thousand in any scene.
//!
//! Times are those of one thread in microseconds, measured on rooms, boxes and buildings; a choice needs no more than their ratios, and
//! must be the same on every machine.

use kernel::geometry::{Bounds, ConvexPolygon, area_vector};
use kernel::occluder::{Occluder, Shaft};

use super::gather;
use crate::settings::{BakeSettings, rays_for};

/// Receivers of a bake with exact rows for each vertex of its shooting mesh: its vertices, those of refinement, and those that measure.
const RECEIVERS: f64 = 10.0;

/// Time of a pair that face each other, and that of each occluder that may stand between.
const PAIR: (f64, f64) = (0.1, 0.05);

/// Time of a ray.
const RAY: f64 = 1.0;

/// Gather points of the smallest scene, and those of each vertex of the shooting mesh for exact rows besides.
const POINTS: (f64, f64) = (2500.0, 2.0);

/// Pairs that are looked at.
const SAMPLED_PAIRS: usize = 2048;

/// Steps of an even sequence of pairs (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018).
const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// The most vertices of a shooting mesh for exact rows with which these cost less than hemisphere rows, if nothing stands between.
pub fn most_vertices_of_exact_rows(settings: &BakeSettings) -> usize {
    most_vertices(settings, PAIR.0)
}

/// Whether exact rows cost less than hemisphere rows, given the occluders and the patches of the shooting mesh for exact rows.
pub fn exact_rows_cost_less(
    settings: &BakeSettings,
    vertices: usize,
    occluders: &[ConvexPolygon],
    patches: &[ConvexPolygon],
) -> bool {
    vertices <= most_vertices(settings, time_of_pair(occluders, patches))
}

/// The number of vertices at which both strategies cost the same, given the mean time of a pair.
fn most_vertices(settings: &BakeSettings, pair: f64) -> usize {
    // Where rays are given, but too few for the error: the same accuracy is compared.
    let needed = BakeSettings::default().with_rays(rays_for(settings.asked_error()));
    let rays = RAY * f64::from(gather::rays::of_receiver(settings).max(gather::rays::of_receiver(&needed)));
    let (least, each) = POINTS;
    // pair · RECEIVERS · v² = rays · (least + each · v)
    let half = rays * each / (2.0 * pair * RECEIVERS);
    (half + (half * half + rays * least / (pair * RECEIVERS)).sqrt()) as usize
}

/// The mean time of a pair of patches.
fn time_of_pair(occluders: &[ConvexPolygon], patches: &[ConvexPolygon]) -> f64 {
    let occluder = Occluder::new(occluders);
    let drawn = |index: usize, step: f64| {
        let place = ((index as f64 + 0.5) * step).fract() * patches.len() as f64;
        &patches[place as usize]
    };
    let mut between = vec![];
    let time = |index| {
        let [from, to] = STEPS.map(|step| drawn(index, step));
        if !faces(from, to) || !faces(to, from) {
            return 0.0;
        }
        let [from, to] = [from, to].map(|polygon| Bounds::around(&polygon.corners));
        occluder.candidates(&Shaft::new(&from, &to, 0.0), &mut between);
        PAIR.0 + PAIR.1 * between.len() as f64
    };
    let times: f64 = (0..SAMPLED_PAIRS).map(time).sum();
    times / SAMPLED_PAIRS as f64
}

/// Whether any corner of a polygon lies before another.
fn faces(polygon: &ConvexPolygon, other: &ConvexPolygon) -> bool {
    let normal = area_vector(&polygon.corners);
    polygon.plane != other.plane
        && other.corners.iter().any(|corner| normal.dot(*corner - polygon.corners[0]) > 0.0)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use kernel::geometry::PlaneId;

    use super::*;

    /// Two walls of `across` by `across` squares that face each other at a distance of 1.
    fn walls(across: usize) -> Vec<ConvexPolygon> {
        let edge = 1.0 / across as f64;
        let square = |wall: u32, index: usize| {
            let at = DVec3::new((index % across) as f64, (index / across) as f64, 0.0) * edge;
            let mut corners = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y]
                .map(|corner| at + corner * edge + DVec3::Z * f64::from(wall));
            if wall == 1 {
                corners.reverse();
            }
            ConvexPolygon { plane: PlaneId(wall), corners: corners.to_vec() }
        };
        (0..2).flat_map(|wall| (0..across * across).map(move |index| square(wall, index))).collect()
    }

    /// Small squares halfway between the walls.
    fn panels(across: usize) -> Vec<ConvexPolygon> {
        let moved = |mut panel: ConvexPolygon| {
            panel.corners.iter_mut().for_each(|corner| *corner += DVec3::Z * 0.5);
            ConvexPolygon { plane: PlaneId(2), ..panel }
        };
        walls(across).into_iter().take(across * across).map(moved).collect()
    }

    #[test]
    fn half_of_the_pairs_of_two_walls_face_each_other() {
        let time = time_of_pair(&[], &walls(8));
        assert!((time / PAIR.0 - 0.5).abs() < 0.05, "{time}");
    }

    #[test]
    fn every_occluder_between_costs() {
        let time = |across| time_of_pair(&panels(across), &walls(8)) / time_of_pair(&[], &walls(8));
        let one = (PAIR.0 + PAIR.1) / PAIR.0;
        assert!((time(1) / one - 1.0).abs() < 1e-9, "{}", time(1));
        assert!(time(8) > 1.5 * one && time(32) > 4.0 * time(8), "{} and {}", time(8), time(32));
    }

    #[test]
    fn occluders_and_vertices_speak_for_rays_and_small_errors_for_exact_rows() {
        let is_exact = |error: f64, vertices: usize, panels: &[ConvexPolygon]| {
            exact_rows_cost_less(&BakeSettings::for_error(error), vertices, panels, &walls(8))
        };
        assert!(is_exact(0.05, 800, &[]));
        assert!(!is_exact(0.05, 800, &panels(32)));
        assert!(!is_exact(0.05, 8000, &[]));
        assert!(is_exact(0.005, 8000, &[]));
    }
}
