//! A sky of one radiance all around.
//!
//! Rays leave a receiver with the density of the cosine: the part of them that nothing stops is the visible form factor. No polygon
//! stands for the sky, and each ray counts the same.

use super::TransparentOccluders;
use super::ratio::RayRatio;
use crate::hemisphere::directions;
use crate::messages::RowStatistics;
use crate::occluder::Occluder;
use crate::replica::Receiver;

/// The visible form factor of the sky at a receiver: the part of its rays that no occluder stops.
#[must_use]
pub fn sky_factor(
    receiver: &Receiver,
    occluder: &Occluder,
    transparent: Option<&TransparentOccluders>,
    rays: u32,
    seed: u32,
    statistics: &mut RowStatistics,
) -> f64 {
    statistics.pairs += 1;
    statistics.factors += 1;
    statistics.factor_sum += 1.0;
    if occluder.is_empty() && transparent.is_none() {
        return 1.0;
    }
    let mut ratio = RayRatio::default();
    let Receiver { position, normal, plane } = *receiver;
    for (number, direction) in directions(normal, rays, seed) {
        let along = -direction;
        let part = if occluder.blocks_from_far(position, along, plane) {
            0.0
        } else {
            transparent.map_or(1.0, |some| some.from_far(position, along, plane))
        };
        ratio.add(number >= rays / 2, 1.0, part);
    }
    statistics.rays += u64::from(rays);
    statistics.sampled_pairs += 1;
    statistics.occluded_pairs += 1;
    if let Some((_, difference)) = ratio.estimate() {
        statistics.sampling_variance += difference * difference / 4.0;
    }
    let (arrived, cast) = ratio.sums();
    arrived / cast
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::form_factor::PreparedPolygon;
    use crate::geometry::{ConvexPolygon, PlaneId};

    fn panel(half: f64, height: f64) -> ConvexPolygon {
        let corner = |(x, z): (f64, f64)| DVec3::new(half * x, height, half * z);
        // It faces down.
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(corner).to_vec();
        ConvexPolygon { plane: PlaneId(1), corners }
    }

    #[test]
    fn what_a_panel_leaves_of_the_sky_is_what_it_does_not_cover() {
        let receiver = Receiver { position: DVec3::new(0.2, 0.0, -0.1), normal: DVec3::Y, plane: PlaneId(0) };
        for (half, height) in [(0.5, 2.0), (1.0, 1.0), (3.0, 0.5)] {
            let panel = panel(half, height);
            let prepared = PreparedPolygon::new(&panel);
            let covered =
                prepared.view(receiver.position, receiver.normal, 0.0).map_or(0.0, |view| view.factor);
            assert!(covered > 0.03, "{covered}");
            let pane = TransparentOccluders::new(std::slice::from_ref(&panel), &[0.5]);
            let nothing = Occluder::new(&[]);
            let mut statistics = RowStatistics::default();
            let factor = sky_factor(&receiver, &nothing, Some(&pane), 1024, 7, &mut statistics);
            assert!((factor + covered / 2.0 - 1.0).abs() <= 0.01, "{factor} behind {covered}");
            let occluder = Occluder::new(&[panel]);
            let mut statistics = RowStatistics::default();
            let factor = sky_factor(&receiver, &occluder, None, 1024, 7, &mut statistics);
            assert_eq!(statistics.rays, 1024);
            assert!((factor + covered - 1.0).abs() <= 0.01, "{factor} beside {covered}");
            assert!(statistics.sampling_variance.sqrt() <= 0.01);
        }
        let nothing = Occluder::new(&[]);
        let mut statistics = RowStatistics::default();
        assert_eq!(sky_factor(&receiver, &nothing, None, 1024, 7, &mut statistics), 1.0);
        assert_eq!(statistics.rays, 0);
    }
}
