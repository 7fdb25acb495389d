//! The visible difference between a picture of a bake and the truth.

use glam::DVec3;
use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageRgb8};

/// FLIP (P. Andersson et al., *FLIP: A Difference Evaluator for Alternating Images*, 2020): 0 where two pictures look the same, 1 at most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flip {
    /// Mean over the pixels.
    pub mean: f64,
    /// 99th percentile over the pixels.
    pub p99: f64,
}

/// FLIP of each pixel of a picture of a bake: both pictures are linear, 1 is white, row by row from the top, of this width. They are
/// seen at 67 pixels to a degree. Nothing for pictures without a pixel, or with an incomplete row.
#[must_use]
pub fn flip(truth: &[DVec3], lit: &[DVec3], width: u32) -> Vec<f32> {
    let rows = truth.len() / (width as usize).max(1);
    let is_whole = rows > 0 && truth.len() == lit.len() && truth.len() == rows * width as usize;
    let (Ok(height), true) = (u32::try_from(rows), is_whole) else { return vec![] };
    let image = |pixels: &[DVec3]| {
        let bytes: Vec<u8> = pixels.iter().flat_map(DVec3::to_array).map(srgb).collect();
        FlipImageRgb8::with_data(width, height, &bytes)
    };
    nv_flip::flip(image(truth), image(lit), DEFAULT_PIXELS_PER_DEGREE).to_vec()
}

impl Flip {
    /// The figures of some pixels; `None` of none.
    #[must_use]
    pub fn of(mut pixels: Vec<f32>) -> Option<Self> {
        pixels.sort_unstable_by(f32::total_cmp);
        let p99 = *pixels.get((pixels.len() * 99).div_ceil(100).checked_sub(1)?)?;
        let sum: f64 = pixels.iter().copied().map(f64::from).sum();
        Some(Self { mean: sum / pixels.len() as f64, p99: p99.into() })
    }
}

/// The byte that shows a linear value: IEC 61966-2-1.
fn srgb(linear: f64) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let shown = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (shown * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp of greys, 64 by 64.
    fn ramp() -> Vec<DVec3> {
        (0..64 * 64).map(|index| DVec3::splat(f64::from(index % 64 + 1) / 64.0)).collect()
    }

    #[test]
    fn equal_pictures_do_not_differ_and_others_do_where_they_are_others() {
        let truth = ramp();
        let same = Flip::of(flip(&truth, &truth, 64)).unwrap();
        assert_eq!((same.mean, same.p99), (0.0, 0.0));
        let mut spotted = truth.clone();
        spotted[32 * 64 + 20..32 * 64 + 24].fill(DVec3::ONE);
        let pixels = flip(&truth, &spotted, 64);
        assert!(pixels[32 * 64 + 21] > 0.2 && pixels[50] < 1e-3, "{} {}", pixels[32 * 64 + 21], pixels[50]);
        let spotted = Flip::of(pixels).unwrap();
        assert!(spotted.mean > 0.0 && spotted.mean < spotted.p99, "{spotted:?}");
    }

    #[test]
    fn what_is_brighter_than_white_is_white() {
        let bright = |by: f64| vec![DVec3::splat(by); 64 * 64];
        let mean = |truth: &[DVec3], lit: &[DVec3]| Flip::of(flip(truth, lit, 64)).unwrap().mean;
        assert_eq!(mean(&bright(2.0), &bright(9.0)), 0.0);
        assert!(mean(&bright(0.5), &bright(0.6)) > 0.02);
    }

    #[test]
    fn black_and_broken_pictures_are_no_fault() {
        let black = [DVec3::ZERO; 4];
        assert_eq!(Flip::of(flip(&black, &black, 2)).unwrap().mean, 0.0);
        assert_eq!(Flip::of(flip(&[], &[], 2)), None);
        assert_eq!(flip(&black, &black, 3).len() + flip(&black, &black[..2], 2).len(), 0);
    }

    #[test]
    fn percentiles_are_those_counted_by_hand() {
        let pixels = (1..=200_u8).map(|n| f32::from(n) / 200.0).collect();
        let found = Flip::of(pixels).unwrap();
        assert!((found.p99 - 0.99).abs() < 1e-6 && (found.mean - 0.5025).abs() < 1e-6, "{found:?}");
    }
}
