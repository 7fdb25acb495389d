//! Light that is linear over a triangle, and samples that it is compared at.

use glam::{DMat2, DVec2, DVec3};

/// A region: the two axes that its triangles are seen along.
#[derive(Debug, Clone, Copy)]
pub struct Region {
    /// Axes left when the longest of the normal is dropped, so that counter-clockwise stays so.
    axes: [usize; 2],
}

impl Region {
    /// For this unit normal.
    pub fn new(normal: DVec3) -> Self {
        let axis = normal.abs().max_position();
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        Self { axes: if normal[axis] > 0.0 { [a, b] } else { [b, a] } }
    }

    /// A point as seen along the longest axis of the normal.
    pub fn flat(&self, point: DVec3) -> DVec2 {
        DVec2::new(point[self.axes[0]], point[self.axes[1]])
    }
}

/// A place where the light is compared with what it was.
#[derive(Debug, Clone)]
pub struct Sample {
    pub position: DVec3,
    /// Radiosity, as it was.
    pub light: DVec3,
    /// Square of the largest deviation.
    pub limit: f64,
    /// Area that it stands for.
    pub weight: f64,
    /// The corners in whose middle it lies.
    pub between: [u32; 2],
}

/// The light in a triangle: linear.
#[derive(Debug, Clone, Copy)]
pub struct LightIn {
    axes: Region,
    origin: DVec2,
    /// Takes an offset to the weights of the second and third corner.
    inverse: DMat2,
    light: [DVec3; 3],
}

impl LightIn {
    /// The light between three positions.
    pub fn new(region: Region, positions: [DVec3; 3], light: [DVec3; 3]) -> Self {
        let [a, b, c] = positions.map(|position| region.flat(position));
        Self { axes: region, origin: a, inverse: DMat2::from_cols(b - a, c - a).inverse(), light }
    }

    /// Weights of the three corners.
    pub fn weights(&self, position: DVec3) -> DVec3 {
        let weights = self.inverse * (self.axes.flat(position) - self.origin);
        DVec3::new(1.0 - weights.x - weights.y, weights.x, weights.y)
    }

    /// Deviation where the weights are these.
    pub fn deviation(&self, weights: DVec3, sample: &Sample) -> DVec3 {
        let [a, b, c] = self.light;
        a * weights.x + b * weights.y + c * weights.z - sample.light
    }

    /// Deviation at a sample.
    pub fn at(&self, sample: &Sample) -> DVec3 {
        self.deviation(self.weights(sample.position), sample)
    }
}
