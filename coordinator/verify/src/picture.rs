//! FLIP: the visible difference between a picture of a bake and the truth, when one takes the other's place.
//!
//! After P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström and M. D. Fairchild, "FLIP: A Difference Evaluator for
//! Alternating Images", HPG 2020: the variant for pictures of low dynamic range at the default viewing distance.

use std::f64::consts::PI;

use document::texture::{linear_to_srgb, srgb_to_linear};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Pixels per degree: a screen of 3840 pixels that is .7 m wide, seen from .7 m.
const PIXELS_PER_DEGREE: f64 = 0.7 * 3840.0 / 0.7 * PI / 180.0;

/// Contrast sensitivity of each opponent channel as two Gaussians: factor and width of each.
const SENSITIVITY: [[f64; 4]; 3] =
    [[1.0, 0.0047, 0.0, 1e-5], [1.0, 0.0053, 0.0, 1e-5], [34.1, 0.04, 13.5, 0.025]];

/// Linear sRGB to XYZ, by columns.
const TO_XYZ: [f64; 9] = [
    10_135_552.0 / 24_577_794.0,
    2_613_072.0 / 12_288_897.0,
    1_425_312.0 / 73_733_382.0,
    8_788_810.0 / 24_577_794.0,
    8_788_810.0 / 12_288_897.0,
    8_788_810.0 / 73_733_382.0,
    4_435_075.0 / 24_577_794.0,
    887_015.0 / 12_288_897.0,
    70_074_185.0 / 73_733_382.0,
];

/// A picture in sRGB, each channel from 0 to 1, line by line.
#[derive(Debug, Clone)]
pub struct Picture {
    /// Pixels in a line.
    pub width: usize,
    /// All pixels.
    pub pixels: Vec<DVec3>,
}

impl Picture {
    /// The picture that shows these linear values, of which 1 is white.
    #[must_use]
    pub fn of_linear(width: usize, values: &[DVec3]) -> Self {
        let shown = |value: &DVec3| value.map(|channel| linear_to_srgb(channel.clamp(0.0, 1.0)));
        Self { width, pixels: values.iter().map(shown).collect() }
    }

    fn map(&self, change: impl Fn(DVec3) -> DVec3) -> Self {
        Self { width: self.width, pixels: self.pixels.iter().map(|pixel| change(*pixel)).collect() }
    }

    /// Filters along lines, then along columns; pixels beyond the border are those on it.
    fn filtered(&self, along: &[DVec3], across: &[DVec3]) -> Self {
        let height = self.pixels.len() / self.width;
        let radius = (along.len() / 2) as isize;
        let clamped = |place: usize, step: usize, length: usize| {
            (place as isize + step as isize - radius).clamp(0, length as isize - 1) as usize
        };
        let places =
            (0..self.pixels.len()).into_par_iter().map(|place| (place % self.width, place / self.width));
        let lines: Vec<DVec3> = places
            .clone()
            .map(|(x, y)| weighed(along, &self.pixels, |step| y * self.width + clamped(x, step, self.width)))
            .collect();
        let pixels = places
            .map(|(x, y)| weighed(across, &lines, |step| clamped(y, step, height) * self.width + x))
            .collect();
        Self { width: self.width, pixels }
    }
}

/// The difference at each pixel, from 0 to 1. Nothing for pictures that differ in size, or have an incomplete line or none.
#[must_use]
pub fn flip(reference: &Picture, test: &Picture) -> Vec<f64> {
    let [size, other] = [reference, test].map(|picture| (picture.width, picture.pixels.len()));
    if size != other || size.0 == 0 || !size.1.is_multiple_of(size.0) {
        return vec![];
    }
    let opponents = [reference, test].map(|picture| picture.map(opponent));
    let colours = opponents.each_ref().map(seen);
    let features = opponents.each_ref().map(features);
    let largest = hyab(hunt(lab(DVec3::Y)), hunt(lab(DVec3::Z))).powf(0.7);
    let pixels = colours[0].pixels.iter().zip(&colours[1].pixels).zip(features[0].iter().zip(&features[1]));
    pixels
        .map(|((one, other), (of_one, of_other))| {
            let difference = hyab(*one, *other).powf(0.7);
            let knee = 0.4 * largest;
            let colour = if difference < knee {
                0.95 * difference / knee
            } else {
                0.95 + 0.05 * (difference - knee) / (largest - knee)
            };
            let feature = (of_one[0] - of_other[0]).abs().max((of_one[1] - of_other[1]).abs());
            colour.powf(1.0 - (feature / 2.0_f64.sqrt()).sqrt())
        })
        .collect()
}

/// The sum of a filter's weights times the values at its steps.
fn weighed(filter: &[DVec3], values: &[DVec3], at: impl Fn(usize) -> usize) -> DVec3 {
    filter.iter().enumerate().map(|(step, weight)| *weight * values[at(step)]).sum()
}

/// Differences of pixels: 0 where two pictures look the same, 1 at most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flip {
    /// Mean over the pixels.
    pub mean: f64,
    /// 99th percentile over the pixels.
    pub p99: f64,
}

impl Flip {
    /// The figures of some pixels; `None` of none.
    #[must_use]
    pub fn of(differences: &[f64]) -> Option<Self> {
        let mut sorted = differences.to_vec();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        let place = last as f64 * 0.99;
        let (low, part) = (place.floor() as usize, place.fract());
        let p99 = sorted[low] * (1.0 - part) + sorted[(low + 1).min(last)] * part;
        Some(Self { mean: differences.iter().sum::<f64>() / differences.len() as f64, p99 })
    }
}

fn to_xyz() -> DMat3 {
    DMat3::from_cols_array(&TO_XYZ)
}

fn white() -> DVec3 {
    to_xyz() * DVec3::ONE
}

fn linear(colour: DVec3) -> DVec3 {
    colour.map(srgb_to_linear)
}

/// sRGB to the opponent space Y Cx Cz.
fn opponent(colour: DVec3) -> DVec3 {
    let xyz = to_xyz() * linear(colour) / white();
    DVec3::new(116.0 * xyz.y - 16.0, 500.0 * (xyz.x - xyz.y), 200.0 * (xyz.y - xyz.z))
}

/// What the eye sees at this distance: L*a*b* with the Hunt effect.
fn seen(opponents: &Picture) -> Picture {
    let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as isize;
    // The sum of two Gaussians is not separable; each is.
    let part = |which: usize| -> (Vec<DVec3>, DVec3) {
        let line = |degrees: f64| {
            let channel = |width: f64| (-PI * PI * degrees * degrees / width).exp();
            DVec3::from_array(SENSITIVITY.map(|terms| channel(terms[2 * which + 1])))
        };
        let filter: Vec<DVec3> =
            (-radius..=radius).map(|step| line(step as f64 / PIXELS_PER_DEGREE)).collect();
        let factor = SENSITIVITY.map(|terms| terms[2 * which] * (PI / terms[2 * which + 1]).sqrt());
        (filter, DVec3::from_array(factor))
    };
    let parts = [part(0), part(1)];
    let total: DVec3 = parts
        .iter()
        .map(|(filter, factor)| {
            let sum: DVec3 = filter.iter().sum();
            *factor * sum * sum
        })
        .sum();
    let [one, two] = parts
        .map(|(filter, factor)| opponents.filtered(&filter, &filter).map(|pixel| pixel * factor / total));
    let pixels = one.pixels.iter().zip(&two.pixels).map(|(a, b)| {
        let filtered = *a + *b;
        let y = (filtered.x + 16.0) / 116.0;
        let xyz = DVec3::new(filtered.y / 500.0 + y, y, y - filtered.z / 200.0) * white();
        hunt(lab((to_xyz().inverse() * xyz).clamp(DVec3::ZERO, DVec3::ONE)))
    });
    Picture { width: opponents.width, pixels: pixels.collect() }
}

/// Linear sRGB to L*a*b*.
fn lab(colour: DVec3) -> DVec3 {
    let root = |value: f64| {
        let delta: f64 = 6.0 / 29.0;
        if value > delta.powi(3) { value.cbrt() } else { value / (3.0 * delta * delta) + 4.0 / 29.0 }
    };
    let [x, y, z] = (to_xyz() * colour / white()).to_array().map(root);
    DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// The Hunt effect: colours in the dark are less so.
fn hunt(lab: DVec3) -> DVec3 {
    DVec3::new(lab.x, 0.01 * lab.x * lab.y, 0.01 * lab.x * lab.z)
}

fn hyab(one: DVec3, other: DVec3) -> f64 {
    let difference = one - other;
    difference.x.abs() + difference.y.hypot(difference.z)
}

/// Strength of edges and points at each pixel.
fn features(opponents: &Picture) -> Vec<[f64; 2]> {
    let deviation = 0.5 * 0.082 * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil() as isize;
    let steps = || (-radius..=radius).map(|step| step as f64);
    let gaussian = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let normalised = |filter: Vec<f64>| -> Vec<DVec3> {
        let sum = |sign: f64| filter.iter().map(|weight| (sign * weight).max(0.0)).sum::<f64>();
        let (above, below) = (sum(1.0), sum(-1.0));
        filter.iter().map(|weight| DVec3::splat(weight / if *weight > 0.0 { above } else { below })).collect()
    };
    let smooth: Vec<f64> = steps().map(gaussian).collect();
    let total: f64 = smooth.iter().sum();
    let smooth: Vec<DVec3> = smooth.into_iter().map(|weight| DVec3::splat(weight / total)).collect();
    let edge = normalised(steps().map(|x| -x * gaussian(x)).collect());
    let point = normalised(steps().map(|x| (x * x / (deviation * deviation) - 1.0) * gaussian(x)).collect());
    let light = opponents.map(|pixel| DVec3::splat((pixel.x + 16.0) / 116.0));
    let strength = |filter: &[DVec3]| -> Vec<f64> {
        let (x, y) = (light.filtered(filter, &smooth), light.filtered(&smooth, filter));
        x.pixels.iter().zip(&y.pixels).map(|(x, y)| x.x.hypot(y.x)).collect()
    };
    strength(&edge).into_iter().zip(strength(&point)).map(|(edge, point)| [edge, point]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean, 99th percentile, and four pixels.
    const EXPECTED: [f64; 6] = [0.295210, 0.783427, 0.097845, 0.508838, 0.418812, 0.782037];

    /// Values of the authors' `flip-evaluator` 1.7 for the same pictures.
    #[test]
    fn it_agrees_with_the_authors_program() {
        let (width, height) = (24, 16);
        let picture = |of: &dyn Fn(f64, f64) -> DVec3| Picture {
            width,
            pixels: (0..width * height).map(|i| of((i % width) as f64, (i / width) as f64)).collect(),
        };
        let reference =
            picture(&|x, y| DVec3::new(x / 23.0, y / 15.0, 0.5 + 0.5 * (x * 0.7).sin() * (y * 0.4).cos()));
        let test = picture(&|x, y| {
            let mut pixel =
                DVec3::new(x / 23.0, y / 15.0, 0.5 + 0.5 * (x * 0.7).sin() * (y * 0.4).cos()) * 0.97;
            if x > 11.0 && y > x / 2.0 {
                pixel *= 0.8;
            }
            if x == 5.0 && y == 5.0 {
                pixel = DVec3::ONE;
            }
            pixel
        });
        let found = flip(&reference, &test);
        let Flip { mean, p99: percentile } = Flip::of(&found).unwrap();
        for (value, expected) in [
            (mean, EXPECTED[0]),
            (percentile, EXPECTED[1]),
            (found[0], EXPECTED[2]),
            (found[5 * width + 5], EXPECTED[3]),
            (found[8 * width + 12], EXPECTED[4]),
            (found[15 * width + 23], EXPECTED[5]),
        ] {
            assert!((value - expected).abs() < 2e-5, "{value} in place of {expected}");
        }
    }

    /// A ramp of greys, 64 by 64.
    fn ramp() -> Vec<DVec3> {
        (0..64 * 64).map(|index| DVec3::splat(f64::from(index % 64 + 1) / 64.0)).collect()
    }

    /// The differences of two pictures of linear values.
    fn differences(truth: &[DVec3], lit: &[DVec3], width: usize) -> Vec<f64> {
        flip(&Picture::of_linear(width, truth), &Picture::of_linear(width, lit))
    }

    #[test]
    fn equal_pictures_do_not_differ_and_others_do_where_they_are_others() {
        let truth = ramp();
        let same = Flip::of(&differences(&truth, &truth, 64)).unwrap();
        assert_eq!((same.mean, same.p99), (0.0, 0.0));
        let mut spotted = truth.clone();
        spotted[32 * 64 + 20..32 * 64 + 24].fill(DVec3::ONE);
        let pixels = differences(&truth, &spotted, 64);
        assert!(pixels[32 * 64 + 21] > 0.2 && pixels[50] < 1e-3, "{} {}", pixels[32 * 64 + 21], pixels[50]);
        let spotted = Flip::of(&pixels).unwrap();
        assert!(spotted.mean > 0.0 && spotted.mean < spotted.p99, "{spotted:?}");
    }

    #[test]
    fn what_is_brighter_than_white_is_white() {
        let bright = |by: f64| vec![DVec3::splat(by); 64 * 64];
        let mean = |truth: &[DVec3], lit: &[DVec3]| Flip::of(&differences(truth, lit, 64)).unwrap().mean;
        assert_eq!(mean(&bright(2.0), &bright(9.0)), 0.0);
        assert!(mean(&bright(0.5), &bright(0.6)) > 0.02);
    }

    #[test]
    fn black_and_broken_pictures_are_no_fault() {
        let black = [DVec3::ZERO; 4];
        assert_eq!(Flip::of(&differences(&black, &black, 2)).unwrap().mean, 0.0);
        assert_eq!(Flip::of(&differences(&[], &[], 2)), None);
        assert_eq!(differences(&black, &black, 3).len() + differences(&black, &black[..2], 2).len(), 0);
    }

    #[test]
    fn percentiles_are_those_counted_by_hand() {
        let pixels: Vec<f64> = (0..=200_u8).map(|n| f64::from(n) / 200.0).collect();
        let found = Flip::of(&pixels).unwrap();
        assert!((found.p99 - 0.99).abs() < 1e-12 && (found.mean - 0.5).abs() < 1e-12, "{found:?}");
    }
}
