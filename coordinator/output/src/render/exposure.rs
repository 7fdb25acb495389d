use std::f64::consts::PI;

use super::Picture;

/// Share of the pixels that show a surface and are not over-exposed.
const PERCENTILE: f64 = 0.95;

/// An exposure that suits a picture: 1 over the 95th percentile of pi x radiance, the largest channel, over the pixels that are not
/// black; where all are, 1. At it 5 % of the picture is clipped by a linear tone map.
#[must_use]
pub fn suitable_exposure(picture: &Picture) -> f64 {
    let largest = |pixel: &[f32; 3]| pixel.iter().copied().fold(0.0, f32::max);
    let mut values: Vec<f32> = picture.pixels.iter().map(largest).filter(|value| *value > 0.0).collect();
    values.sort_by(f32::total_cmp);
    let place = (values.len() as f64 * PERCENTILE) as usize;
    let white = values.get(place.min(values.len().saturating_sub(1))).map_or(0.0, |value| f64::from(*value));
    let exposure = 1.0 / (PI * white);
    if exposure.is_finite() && exposure > 0.0 { exposure } else { 1.0 }
}
