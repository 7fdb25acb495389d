//! How much of a form factor the occluders leave.
//!
//! Where few occluders stand between a point and a polygon, the visible part of the polygon is *computed*: the occluders are
//! cut out of it as the point sees them, and the rest is summed up exactly. Where there are many, rays sample it.

mod cut;
mod sample;

use glam::DVec3;

use crate::form_factor::{PreparedPolygon, contour};
use crate::geometry::Corners;
use crate::occluder::{Occluder, Shaft};
use crate::protocol::RowStatistics;
use crate::replica::Receiver;
use crate::row::Sampling;

pub use sample::pair_seed;

/// With more occluders than this in a shaft, rays are cheaper than cutting.
const MAX_BLOCKERS: usize = 40;

/// With more pieces than this, rays are cheaper than cutting on.
const MAX_PIECES: usize = 64;

/// Computes visible form factors; keeps its buffers from pair to pair.
#[derive(Default)]
pub struct VisibilityBuffers {
    blockers: Vec<Corners>,
    pieces: Vec<Corners>,
    scratch: Vec<Corners>,
}

/// The visible form factor of a receiver's point to a polygon.
///
/// `seed` is the pair's own (see [`pair_seed`]): who computes it does not matter.
pub fn visible_form_factor(
    occluder: &Occluder,
    receiver: &Receiver,
    polygon: &PreparedPolygon,
    sampling: &Sampling,
    seed: u32,
    buffers: &mut VisibilityBuffers,
    statistics: &mut RowStatistics,
) -> f64 {
    if receiver.plane == polygon.plane() {
        return 0.0;
    }
    let Some(view) = polygon.view(receiver.position, receiver.normal) else { return 0.0 };
    statistics.factors += 1;
    if occluder.is_empty() {
        return view.factor;
    }
    let planes = [receiver.plane, polygon.plane()];
    let shaft = Shaft::new(receiver.position, &view.corners, polygon.normal(), planes);
    let few = occluder.collect_blockers(&shaft, MAX_BLOCKERS, &mut buffers.blockers);
    if buffers.blockers.is_empty() {
        return view.factor;
    }
    if few && let Some(visible) = cut_factor(receiver.normal, &view.corners, view.factor, buffers) {
        return visible;
    }
    statistics.sampled_pairs += 1;
    let blocked = |target: DVec3| occluder.blocks(receiver.position, receiver.position + target, planes);
    let rays = sample::ray_count(view.factor, sampling);
    let sample =
        sample::sample_visibility(&view.corners, receiver.normal, polygon.normal(), rays, seed, blocked);
    statistics.rays += u64::from(sample.rays);
    view.factor * sample.fraction
}

/// The form factor of what the blockers leave; `None` when that falls into too many pieces.
fn cut_factor(
    normal: DVec3,
    corners: &Corners,
    unblocked: f64,
    buffers: &mut VisibilityBuffers,
) -> Option<f64> {
    let VisibilityBuffers { blockers, pieces, scratch } = buffers;
    pieces.clear();
    pieces.push(corners.clone());
    let mut touched = false;
    for blocker in blockers.iter() {
        touched |= cut::cut(pieces, blocker, scratch);
        if pieces.is_empty() {
            return Some(0.0);
        }
        if pieces.len() > MAX_PIECES {
            return None;
        }
    }
    if !touched {
        return Some(unblocked);
    }
    Some(pieces.iter().map(|piece| contour(normal, piece)).sum::<f64>().clamp(0.0, unblocked))
}
