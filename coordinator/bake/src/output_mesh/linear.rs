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

    /// The middle of an edge of a triangle that is flat but for rounding gets light between that of the corners, as does that of one
    /// with an area.
    #[test]
    fn light_in_a_triangle_is_between_that_of_its_corners() {
        for height in [0.5, 1e-14, 3e-17, 0.0] {
            let positions = [
                DVec3::new(549.1, 57.0 + height, 0.0),
                DVec3::new(549.1, 56.3, 1.0),
                DVec3::new(549.1, 55.6, 2.0),
            ];
            let light = [0.388, 0.386, 0.384].map(DVec3::splat);
            let inside = LightIn::new(Region::new(DVec3::X), positions, light);
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let position = (positions[a] + positions[b]) / 2.0;
                let sample = Sample { position, light: light[0], limit: 0.0, weight: 0.0, between: [0; 2] };
                let deviation = inside.at(&sample);
                let most = 0.004 + 1e-12;
                assert!(deviation.is_nan() || deviation.abs().max_element() <= most, "{height}: {deviation}");
                let weights = within(inside.weights(position));
                assert!(height < 0.1 || (weights[a] - 0.5).abs() < 1e-12, "{height}: {weights}");
            }
        }
    }
}
