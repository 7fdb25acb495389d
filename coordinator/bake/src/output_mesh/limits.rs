//! How far the light may deviate, and where it is compared.
//!
//! What the eye sees is relative to the light around: a limit is a part of the light at its place, never less than a hundredth of the
//! mean light, so that noise in the dark costs no vertices, and never more than the mean, so that the error stays small where it is bright.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;
use smallvec::SmallVec;

use super::linear::Sample;
use super::working::{Corner, NONE, Triangle, Working};
use crate::refinement::Cap;

/// Largest deviation, relative to the light at its place: what no one sees.
const VISIBLE: f64 = 0.015;

/// Largest deviation over the L2 difference that it comes to.
const LARGEST_PER_MEAN: f64 = 3.0;

/// Deviation that the noise of the rays may explain, in standard errors of a vertex: a few of many are off by that much.
const NOISE: f64 = 4.0;

/// Deviations are relative to this part of the mean light at least.
const DARK: f64 = 0.01;

/// Times that the limits are made tighter.
const MOST_TIGHTENED: u32 = 4;

/// The limits of a mesh.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Largest deviation, relative to the light.
    part: f64,
    /// How bright a place may be before its brightness counts no more.
    cap: Cap,
    /// Root mean square of the radiosity under the cap.
    mean: f64,
    /// Square of the radiosity under the cap, integrated over the mesh.
    norm: f64,
    /// L2 difference that is allowed.
    allowed: f64,
    tightened: u32,
}

impl Limits {
    /// Limits for an L2 difference; `None` where none is allowed, or all is dark.
    pub fn new(working: &Working, allowed: f64, noise: f64) -> Option<Self> {
        let places: Vec<(f64, f64)> = working
            .triangles
            .par_iter()
            .map(|triangle| {
                let area = working.area(triangle);
                let squares = triangle.corners.map(|c| working.corners[c as usize].light.length_squared());
                (squares.iter().sum::<f64>() / 3.0, area)
            })
            .collect();
        let cap = Cap::over(places.clone());
        let norm = cap.norm(&places);
        let area: f64 = places.iter().map(|place| place.1).sum();
        let part = (LARGEST_PER_MEAN * allowed).min(VISIBLE) + NOISE * noise;
        let is_lit = norm.is_finite() && norm > 0.0 && part > 0.0;
        is_lit.then(|| Self { part, cap, mean: (norm / area).sqrt(), norm, allowed, tightened: 0 })
    }

    /// Makes the limits tighter, given the difference that they came to; false where that was done often enough.
    pub fn tighten(&mut self, difference: f64) -> bool {
        self.part *= 0.9 * self.allowed / difference;
        self.tightened += 1;
        self.tightened <= MOST_TIGHTENED
    }

    /// Relative L2 difference of the light from what it was, under the cap.
    pub fn difference(&self, working: &Working) -> f64 {
        let of = |triangle: &Triangle| -> f64 {
            let deviation = working.light_in(triangle);
            let samples = triangle.samples.iter().map(|sample| &working.samples[*sample as usize]);
            let square = |sample: &Sample| {
                let part = self.cap.part(sample.light.length_squared());
                sample.weight * part * deviation.at(sample).length_squared()
            };
            samples.map(square).filter(|square| square.is_finite()).sum()
        };
        let is_alive = |triangle: &&Triangle| triangle.corners[0] != NONE;
        let parts: Vec<f64> = working.triangles.par_iter().filter(is_alive).map(of).collect();
        (parts.into_iter().sum::<f64>() / self.norm).sqrt()
    }

    /// Largest deviation where the radiosity is this.
    pub fn at(&self, light: DVec3) -> f64 {
        self.part * light.length().clamp(DARK * self.mean, self.mean)
    }

    /// Puts a sample in the middle of each edge. Sums over them integrate squares of linear differences exactly.
    pub fn sample(&self, working: &mut Working) {
        let of_corner = |(index, corner): (usize, &Corner)| Sample {
            position: corner.position,
            light: corner.light,
            limit: self.at(corner.light).powi(2),
            weight: 0.0,
            between: [index as u32; 2],
        };
        // How many triangles the sample of each edge stands for: the first of two has it.
        let stands_for = |(index, triangle): (usize, &Triangle)| {
            if triangle.corners[0] == NONE {
                return [0; 3];
            }
            triangle.edges().map(|[a, b]| match working.both_sides(a, b) {
                Some(both) if both[0].min(both[1]) == index as u32 => 2_u8,
                Some(_) => 0,
                None => 1,
            })
        };
        let all = working.triangles.par_iter().enumerate().with_min_len(256);
        let counts: Vec<[u8; 3]> = all.map(stands_for).collect();
        let in_middle = |between: [u32; 2], weight: f64| {
            let [a, b] = between.map(|corner| &working.corners[corner as usize]);
            let light = (a.light + b.light) / 2.0;
            Sample {
                position: (a.position + b.position) / 2.0,
                light,
                limit: self.at(light).powi(2),
                weight,
                between,
            }
        };
        let in_middles = |(triangle, counts): (&Triangle, &[u8; 3])| -> SmallVec<[Sample; 3]> {
            if *counts == [0; 3] {
                return SmallVec::new();
            }
            let weight = working.area(triangle) / 3.0;
            let own = triangle.edges().into_iter().zip(counts).filter(|(_, count)| **count > 0);
            own.map(|(edge, count)| in_middle(edge, weight * f64::from(*count))).collect()
        };
        // Each corner has a sample for when it is gone, with its own number.
        let of_edges: usize = counts.iter().flatten().filter(|count| **count > 0).count();
        let mut samples: Vec<Sample> = Vec::with_capacity(working.corners.len() + of_edges);
        samples.par_extend(working.corners.par_iter().enumerate().map(of_corner));
        let mut next = samples.len() as u32;
        let in_triangles = working.triangles.par_iter().zip(&counts).with_min_len(256);
        samples.par_extend(in_triangles.flat_map_iter(in_middles));
        let take = |counts: &[u8; 3]| {
            let first = next;
            next += counts.iter().filter(|count| **count > 0).count() as u32;
            first..next
        };
        let numbers: Vec<Range<u32>> = counts.iter().map(take).collect();
        let triangles = working.triangles.par_iter_mut().zip(numbers).with_min_len(256);
        triangles.for_each(|(triangle, numbers)| triangle.samples.extend(numbers));
        working.samples = samples;
    }
}
