//! All the receivers of a row.

use std::f64::consts::TAU;

use super::{EXACT, FULL_DIGITS, LANES, PreparedPolygon, ReceiverLanes, ViewLanes, angle, is_exact};

impl PreparedPolygon {
    /// What each receiver of a row sees of the polygon: [`PreparedPolygon::view_lanes`] for each block, and the receivers whose
    /// horizon cuts the polygon gathered in blocks of their own, as their sum costs more than the other.
    ///
    /// `views` has as many blocks as `receivers`; what is beyond the shorter is left alone. To be called under
    /// [`crate::simd::widest`].
    #[inline(always)]
    pub fn view_row(&self, receivers: &[ReceiverLanes], tolerance: f64, views: &mut [ViewLanes]) {
        let mut cut = Vec::new();
        for (block, (receivers, view)) in receivers.iter().zip(views.iter_mut()).enumerate() {
            *view = self.view_lanes(receivers, tolerance);
            let mut left = view.cut;
            while left != 0 {
                cut.push((block, left.trailing_zeros() as usize));
                left &= left - 1;
            }
        }
        for places in cut.chunks(LANES) {
            self.answer_cut(receivers, places, tolerance, views);
        }
    }

    /// Answers receivers, given by block and lane, whose horizon cuts the polygon.
    #[inline(always)]
    fn answer_cut(
        &self,
        receivers: &[ReceiverLanes],
        places: &[(usize, usize)],
        tolerance: f64,
        views: &mut [ViewLanes],
    ) {
        let mut gathered = ReceiverLanes::new([]);
        for (lane, (block, from)) in places.iter().enumerate() {
            for axis in 0..3 {
                gathered.position[axis][lane] = receivers[*block].position[axis][*from];
                gathered.normal[axis][lane] = receivers[*block].normal[axis][*from];
            }
        }
        let tolerance = tolerance.max(EXACT);
        let sum = if tolerance < FULL_DIGITS {
            self.cut_lanes::<angle::Full>(&gathered)
        } else {
            self.cut_lanes::<angle::Quick>(&gathered)
        };
        for (lane, (block, home)) in places.iter().enumerate() {
            if is_exact(sum.factors[lane], sum.error_bounds[lane], tolerance) {
                views[*block].factors[*home] = (sum.factors[lane] / TAU).min(1.0);
                views[*block].unanswered &= !(1 << home);
            }
        }
    }
}
