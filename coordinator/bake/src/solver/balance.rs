//! The energy balance.

use glam::DVec3;
use serde::Serialize;

/// Fluxes in W (or lumen), RGB. Emitted = absorbed + unshot + escaped + imbalance.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct EnergyBalance {
    /// Emitted by the light sources; of directional lights and the sky, the part that lit sides stop.
    pub emitted: [f64; 3],
    /// Absorbed by surfaces.
    pub absorbed: [f64; 3],
    /// Reflected and not yet shot.
    pub unshot: [f64; 3],
    /// Lost from an open scene, or to the backs of one-sided surfaces.
    pub escaped: [f64; 3],
    /// The remainder: discretisation error of the mesh.
    pub imbalance: [f64; 3],
}

impl EnergyBalance {
    /// The balance of these fluxes.
    #[must_use]
    pub fn new(emitted: DVec3, absorbed: DVec3, unshot: DVec3, escaped: DVec3) -> Self {
        let imbalance = emitted - absorbed - unshot - escaped;
        Self {
            emitted: emitted.to_array(),
            absorbed: absorbed.to_array(),
            unshot: unshot.to_array(),
            escaped: escaped.to_array(),
            imbalance: imbalance.to_array(),
        }
    }

    /// Imbalance relative to the emitted flux, over all channels.
    #[must_use]
    pub fn relative_imbalance(&self) -> f64 {
        let emitted: f64 = self.emitted.iter().sum();
        if emitted > 0.0 { self.imbalance.iter().sum::<f64>() / emitted } else { 0.0 }
    }
}

/// How much of their hemisphere vertices see covered by the scene: sums of form factors, before any is bounded.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RowSums {
    /// Smallest sum.
    pub least: f64,
    /// Mean over the area.
    pub mean: f64,
    /// Largest sum.
    pub largest: f64,
    /// Part of the area by sum: below .5, .9, .99, .999, up to 1.001, above.
    pub histogram: [f64; 6],
}

/// Upper ends of the histogram's classes; the last class has none.
pub const ROW_SUM_CLASSES: [f64; 5] = [0.5, 0.9, 0.99, 0.999, 1.001];

impl RowSums {
    /// Statistics of (sum, area) pairs.
    #[must_use]
    pub fn new(sums: &[(f64, f64)]) -> Self {
        let area: f64 = sums.iter().map(|(_, area)| area).sum();
        let mut histogram = [0.0; 6];
        for (sum, share) in sums {
            let class = ROW_SUM_CLASSES.iter().position(|end| sum < end).unwrap_or(ROW_SUM_CLASSES.len());
            histogram[class] += share / area;
        }
        Self {
            least: sums.iter().map(|(sum, _)| *sum).fold(f64::INFINITY, f64::min),
            mean: sums.iter().map(|(sum, area)| sum * area).sum::<f64>() / area,
            largest: sums.iter().map(|(sum, _)| *sum).fold(0.0, f64::max),
            histogram,
        }
    }
}
