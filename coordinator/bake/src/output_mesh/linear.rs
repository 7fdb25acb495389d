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
        let ([a, b, c], weights) = (self.light, within(weights));
        a * weights.x + b * weights.y + c * weights.z - sample.light
    }

    /// Deviation at a sample.
    pub fn at(&self, sample: &Sample) -> DVec3 {
        self.deviation(self.weights(sample.position), sample)
    }
}

/// Weights of a place in the triangle where these, but for rounding, are of one. In a triangle that is hardly more than a line rounding may
/// be all of them, a million and more.
pub fn within(weights: DVec3) -> DVec3 {
    let weights = weights.max(DVec3::ZERO);
    weights / weights.element_sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asserts that the middles of edges get light between that of the corners. Returns the largest of their weights before these are
    /// bounded.
    fn largest_weight(positions: [DVec3; 3]) -> f64 {
        let light = [0.388, 0.3861, 0.384].map(DVec3::splat);
        let inside = LightIn::new(Region::new(DVec3::Z), positions, light);
        let edges = [(0, 1), (1, 2), (2, 0)];
        let weight = |(a, b): (usize, usize)| {
            let position = (positions[a] + positions[b]) / 2.0;
            let sample = Sample { position, light: light[0], limit: 0.0, weight: 0.0, between: [0; 2] };
            let deviation = inside.at(&sample).abs().max_element();
            assert!(deviation <= 0.004 + 1e-12, "{deviation}");
            inside.weights(position).abs().max_element()
        };
        edges.into_iter().map(weight).fold(0.0, f64::max)
    }

    #[test]
    fn light_in_a_triangle_is_between_that_of_its_corners() {
        let flat = [
            [549.100_757_264_198_1, 57.066_092_801_336_08],
            [549.100_757_264_198, 56.376_052_500_399_72],
            [549.100_757_264_197_9, 55.686_012_199_463_356],
        ];
        let [a, b, c] = flat.map(|[x, y]| DVec3::new(x, y, 0.0));
        assert!(largest_weight([a, b, c]) > 1e6);
        assert!((largest_weight([a, b + DVec3::X, c]) - 0.5).abs() < 1e-9);
    }
}
