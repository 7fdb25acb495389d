//! Random numbers that are the same everywhere.

use glam::DVec3;

/// Splitmix64.
#[derive(Debug, Clone)]
pub struct Numbers(u64);

impl Numbers {
    /// The sequence of a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// In [0, 1).
    pub fn part(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// In [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.part()
    }

    /// In [low, high), both above 0, each power of ten as likely as another.
    pub fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// In 0..count.
    pub fn below(&mut self, count: usize) -> usize {
        (self.part() * count as f64) as usize
    }

    /// True as often as this part says.
    pub fn chance(&mut self, part: f64) -> bool {
        self.part() < part
    }

    /// One of these.
    ///
    /// # Panics
    /// When there are none.
    pub fn of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())]
    }

    /// A point in a box.
    pub fn point(&mut self, low: DVec3, high: DVec3) -> DVec3 {
        let [x, y, z] = [0, 1, 2].map(|axis| self.between(low[axis], high[axis]));
        DVec3::new(x, y, z)
    }

    /// A direction, all as likely.
    pub fn direction(&mut self) -> DVec3 {
        let (height, turn) = (self.between(-1.0, 1.0), self.between(0.0, std::f64::consts::TAU));
        let flat = (1.0 - height * height).sqrt();
        DVec3::new(flat * turn.cos(), height, flat * turn.sin())
    }
}
