//! The visible part of a form factor, estimated with rays.

use std::ops::AddAssign;

/// A ratio of weighted sums over the same rays: what arrives over what is cast. Both halves of the rays are nets of their own, so
/// that their difference shows what another draw would change.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct RayRatio {
    arrived: [f64; 2],
    cast: [f64; 2],
}

impl AddAssign for RayRatio {
    fn add_assign(&mut self, other: Self) {
        for half in 0..2 {
            self.arrived[half] += other.arrived[half];
            self.cast[half] += other.cast[half];
        }
    }
}

impl RayRatio {
    /// Adds a ray of one half with a weight, the kernel of the form factor, of which `part` arrives.
    pub fn add(&mut self, is_second_half: bool, weight: f64, part: f64) {
        let half = usize::from(is_second_half);
        self.cast[half] += weight;
        self.arrived[half] += weight * part;
    }

    /// What arrives, and what is cast, of all rays.
    pub fn sums(&self) -> (f64, f64) {
        (self.arrived[0] + self.arrived[1], self.cast[0] + self.cast[1])
    }

    /// The ratio of each half; not finite where no ray of it was cast.
    pub fn halves(&self) -> [f64; 2] {
        [0, 1].map(|half| self.arrived[half] / self.cast[half])
    }

    /// The ratio of all rays, and the difference of both halves; `None` where one half has no ray.
    pub fn estimate(&self) -> Option<(f64, f64)> {
        let ([a, b], (arrived, cast)) = (self.halves(), self.sums());
        (a.is_finite() && b.is_finite()).then(|| (arrived / cast, a - b))
    }
}
