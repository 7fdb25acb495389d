//! Vectors of several points side by side, for vector instructions.

use glam::DVec3;

/// Points that are treated together: two vectors of AVX-512, so that one computes while the other waits.
pub const LANES: usize = 16;

/// One yes or no for each point: bit 0 is that of the first.
pub type Mask = u16;

/// One vector for each point, coordinate by coordinate.
#[derive(Debug, Clone, Copy)]
pub struct Vectors {
    /// Coordinates along x.
    pub x: [f64; LANES],
    /// Coordinates along y.
    pub y: [f64; LANES],
    /// Coordinates along z.
    pub z: [f64; LANES],
}

impl Vectors {
    /// All of them zero.
    pub const ZERO: Self = Self { x: [0.0; LANES], y: [0.0; LANES], z: [0.0; LANES] };

    /// Some vectors, and again from the first until all lanes are full.
    #[must_use]
    pub fn repeated(vectors: &[DVec3]) -> Self {
        let mut all = Self::ZERO;
        for (lane, vector) in vectors.iter().cycle().take(LANES).enumerate() {
            all.set(lane, *vector);
        }
        all
    }

    /// Sets one of them.
    pub fn set(&mut self, lane: usize, vector: DVec3) {
        (self.x[lane], self.y[lane], self.z[lane]) = (vector.x, vector.y, vector.z);
    }

    /// One of them.
    #[must_use]
    pub fn get(&self, lane: usize) -> DVec3 {
        DVec3::new(self.x[lane], self.y[lane], self.z[lane])
    }
}
