//! Values of the vertices that are left: those of least square difference from the light before.
//!
//! Values that a vertex had for itself put the light between distant vertices on one side of the truth, and keep the noise of single
//! vertices. The best fit evens both out. It is linear in the light, so that layers still sum to the whole.

use glam::DVec3;
use rayon::prelude::*;
use smallvec::SmallVec;

use super::limits::Limits;
use super::linear::{LightIn, within};
use super::working::{Corner, NONE, Triangle, Working};

/// Iterations of conjugate gradients: the matrix of linear functions on triangles needs no more. They leave half a per cent of the change.
const ITERATIONS: usize = 8;

/// Fewest corners that a thread takes.
const AT_ONCE: usize = 1024;

/// Weight of the values that vertices had, against the light around them.
const OWN: f64 = 0.02;

/// The triangles of a corner, each with the corner's place in it.
type Around = SmallVec<[(u32, u8); 8]>;

/// Least squares over the samples of each triangle.
pub struct Fit {
    /// By triangle; empty where it is gone.
    triangles: Vec<Element>,
    /// By corner.
    around: Vec<Around>,
    /// Diagonal of the matrix, with the weight of the old values.
    diagonal: Vec<f64>,
    /// Weight of the old values.
    own: Vec<f64>,
    /// Part of the way to the fit that each corner goes.
    part: Vec<f64>,
    /// The fitted irradiance, by corner.
    pub irradiance: Vec<DVec3>,
}

#[derive(Default)]
struct Element {
    corners: [u32; 3],
    /// Sums over the samples of weight times products of interpolation weights: of both corners of each edge, then of each corner.
    products: [f64; 6],
    /// Corners that each sample lies between, and its weight times the interpolation weights.
    samples: Vec<([u32; 2], DVec3)>,
}

impl Element {
    fn new(working: &Working, triangle: &Triangle) -> Self {
        if triangle.corners[0] == NONE {
            return Self::default();
        }
        let light: LightIn = working.light_in(triangle);
        let mut element = Self { corners: triangle.corners, products: [0.0; 6], samples: vec![] };
        for sample in &triangle.samples {
            let sample = &working.samples[*sample as usize];
            let weights = within(light.weights(sample.position));
            if sample.weight > 0.0 && weights.is_finite() {
                let [a, b, c] = weights.to_array();
                let products = [a * b, b * c, c * a, a * a, b * b, c * c];
                for (sum, product) in element.products.iter_mut().zip(products) {
                    *sum += sample.weight * product;
                }
                element.samples.push((sample.between, weights * sample.weight));
            }
        }
        element
    }

    /// The row of the matrix of the corner at a place, times values.
    fn times(&self, place: u8, values: &[DVec3]) -> DVec3 {
        let [ab, bc, ca, aa, bb, cc] = self.products;
        let [a, b, c] = match place {
            0 => [aa, ab, ca],
            1 => [ab, bb, bc],
            _ => [ca, bc, cc],
        };
        let [i, j, k] = self.corners.map(|corner| values[corner as usize]);
        i * a + j * b + k * c
    }

    /// What the samples add to the right-hand side of the corner at a place.
    fn sampled(&self, place: u8, values: &[DVec3]) -> DVec3 {
        let middle = |[a, b]: &[u32; 2]| (values[*a as usize] + values[*b as usize]) / 2.0;
        self.samples.iter().map(|(between, weights)| middle(between) * weights[place as usize]).sum()
    }
}

impl Fit {
    /// The fit of a mesh, no farther from its values than the limits allow, given the irradiance of the lit mesh's vertices.
    pub fn new(working: &Working, limits: &Limits, irradiance: &[DVec3]) -> Self {
        let triangles: Vec<Element> =
            working.triangles.par_iter().map(|triangle| Element::new(working, triangle)).collect();
        let around = |(index, corner): (u32, &Corner)| {
            let place = |triangle: &u32| {
                let corners = triangles[*triangle as usize].corners;
                (*triangle, corners.iter().position(|own| *own == index).unwrap_or(0) as u8)
            };
            corner.around.iter().map(place).collect()
        };
        let corners = (0..working.corners.len() as u32).into_par_iter().zip(&working.corners);
        let around: Vec<Around> = corners.map(around).collect();
        let diagonal = |around: &Around| -> f64 {
            around
                .iter()
                .map(|(triangle, place)| triangles[*triangle as usize].products[3 + *place as usize])
                .sum()
        };
        let diagonal: Vec<f64> = around.par_iter().map(diagonal).collect();
        let own: Vec<f64> = diagonal.iter().map(|diagonal| OWN * diagonal + f64::MIN_POSITIVE).collect();
        let diagonal = diagonal.iter().zip(&own).map(|(diagonal, own)| diagonal + own).collect();
        let mut fit = Self { triangles, around, diagonal, own, part: vec![], irradiance: vec![] };
        let before = working.of_corners(irradiance);
        let change = fit.change(&before);
        let part = |((corner, before), change): ((&Corner, &DVec3), &DVec3)| {
            let step = working.weighted(corner, *change).length();
            // What no light reaches stays dark: a wall must not leak, not even by rounding.
            let reached = *before != DVec3::ZERO;
            if reached && step > 0.0 { (limits.at(corner.light) / step).min(1.0) } else { 0.0 }
        };
        fit.part = working.corners.iter().zip(&before).zip(&change).map(part).collect();
        fit.irradiance = fit.moved(&before, change);
        fit
    }

    /// Fits values, given those that all corners had.
    pub fn apply(&self, values: &[DVec3]) -> Vec<DVec3> {
        self.moved(values, self.change(values))
    }

    fn moved(&self, values: &[DVec3], change: Vec<DVec3>) -> Vec<DVec3> {
        let parts = values.iter().zip(change).zip(&self.part);
        parts.map(|((value, change), part)| *value + change * *part).collect()
    }

    /// How far the best fit lies from the values that all corners had.
    fn change(&self, values: &[DVec3]) -> Vec<DVec3> {
        let mut residual = self.residual(values);
        let mut change = vec![DVec3::ZERO; values.len()];
        let over = |a: DVec3, b: DVec3| DVec3::select(b.cmpgt(DVec3::ZERO), a / b, DVec3::ZERO);
        let mut direction = self.preconditioned(&residual);
        let mut square = dot(&residual, &direction);
        for _ in 0..ITERATIONS {
            let product = self.times(&direction);
            let step = over(square, dot(&direction, &product));
            let along = change.par_iter_mut().zip(&mut residual).zip(direction.par_iter().zip(&product));
            along.with_min_len(AT_ONCE).for_each(|((change, residual), (direction, product))| {
                *change += step * *direction;
                *residual -= step * *product;
            });
            let scaled = self.preconditioned(&residual);
            let next = dot(&residual, &scaled);
            let turn = over(next, square);
            let turned = direction.par_iter_mut().zip(&scaled).with_min_len(AT_ONCE);
            turned.for_each(|(own, scaled)| *own = *scaled + turn * *own);
            square = next;
        }
        change
    }

    /// A residual over the diagonal of the matrix.
    fn preconditioned(&self, residual: &[DVec3]) -> Vec<DVec3> {
        let all = residual.par_iter().zip(&self.diagonal).with_min_len(AT_ONCE);
        all.map(|(residual, diagonal)| *residual / *diagonal).collect()
    }

    /// What is left to be fitted where all corners have these values.
    fn residual(&self, values: &[DVec3]) -> Vec<DVec3> {
        let of_corner = |around: &Around| {
            let of_triangle = |(triangle, place): &(u32, u8)| {
                let element = &self.triangles[*triangle as usize];
                element.sampled(*place, values) - element.times(*place, values)
            };
            around.iter().map(of_triangle).sum()
        };
        self.around.par_iter().with_min_len(AT_ONCE).map(of_corner).collect()
    }

    /// The matrix times values, with the weight of the old ones.
    fn times(&self, values: &[DVec3]) -> Vec<DVec3> {
        let of_corner = |(index, around): (usize, &Around)| {
            let of_triangle =
                |(triangle, place): &(u32, u8)| self.triangles[*triangle as usize].times(*place, values);
            values[index] * self.own[index] + around.iter().map(of_triangle).sum::<DVec3>()
        };
        self.around.par_iter().enumerate().with_min_len(AT_ONCE).map(of_corner).collect()
    }
}

/// Sum of products, channel by channel: in blocks, so that it does not depend on the number of threads.
fn dot(a: &[DVec3], b: &[DVec3]) -> DVec3 {
    let blocks = a.par_chunks(AT_ONCE).zip(b.par_chunks(AT_ONCE));
    let sums: Vec<DVec3> = blocks.map(|(a, b)| a.iter().zip(b).map(|(a, b)| *a * *b).sum()).collect();
    sums.into_iter().sum()
}
