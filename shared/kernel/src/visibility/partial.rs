//! What a receiver sees of a polygon that occluders hide in part.

use glam::DVec3;

use super::cut::{Cones, Pieces, cut};
use super::sample;
use crate::form_factor::{PreparedPolygon, contour};
use crate::geometry::{Corners, PlaneId};
use crate::messages::RowStatistics;
use crate::occluder::{Blocker, Occluder};
use crate::row::Precision;

/// Polygons that fall into more pieces than this are sampled.
const MAX_PIECES: usize = 64;

/// Visible parts below this part of the unoccluded factor are rounding along seams of blockers.
const ROUNDING: f64 = 1e-12;

/// The blockers of one receiver, and the pieces that they leave.
#[derive(Debug, Default)]
pub struct PartialView {
    cones: Cones,
    pieces: Pieces,
    scratch: Pieces,
    relative: Corners,
}

impl PartialView {
    /// Forgets all blockers.
    pub fn clear(&mut self) {
        self.cones.clear();
    }

    /// True when there are no blockers.
    pub fn is_free(&self) -> bool {
        self.cones.is_empty()
    }

    /// Adds a blocker of the view from a point.
    pub fn add(&mut self, blocker: Blocker<'_>, point: DVec3) {
        match blocker {
            Blocker::Polygon(corners) => {
                self.relative.clear();
                self.relative.extend(corners.iter().map(|corner| *corner - point));
                self.cones.push_polygon(&self.relative);
            }
            Blocker::Outline(body) => self.cones.push_outline(body, point),
        }
    }

    /// The visible part of a form factor whose unoccluded value is known.
    #[allow(clippy::too_many_arguments)]
    pub fn factor(
        &mut self,
        occluder: &Occluder,
        precision: &Precision,
        (position, normal, plane): (DVec3, DVec3, PlaneId),
        polygon: &PreparedPolygon,
        unoccluded: f64,
        seed: u32,
        statistics: &mut RowStatistics,
    ) -> f64 {
        let corners = polygon.corners_above(position, normal);
        if self.cones.len() <= precision.exact_occluders as usize
            && let Some(visible) = self.cut(&corners, normal, unoccluded)
        {
            return visible;
        }
        sample::sampled_factor(
            occluder,
            precision,
            (position, normal, plane),
            polygon,
            unoccluded,
            seed,
            statistics,
        )
    }

    /// The visible factor by cutting the blockers out of the polygon; `None` where it falls into too many pieces.
    fn cut(&mut self, corners: &Corners, normal: DVec3, unoccluded: f64) -> Option<f64> {
        self.pieces.clear();
        self.pieces.push(corners);
        let mut touched = false;
        for cone in self.cones.iter() {
            touched |= cut(&mut self.pieces, cone, &mut self.scratch);
            if self.pieces.is_empty() {
                return Some(0.0);
            }
            if self.pieces.len() > MAX_PIECES {
                return None;
            }
        }
        if !touched {
            return Some(unoccluded);
        }
        let visible: f64 = self.pieces.iter().map(|piece| contour(normal, piece)).sum();
        Some(if visible <= ROUNDING * unoccluded { 0.0 } else { visible.min(unoccluded) })
    }
}
