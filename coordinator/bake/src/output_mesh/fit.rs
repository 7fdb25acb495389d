//! Values of the vertices that are left: those of least square difference from the light before.
//!
//! Values that a vertex had for itself put the light between distant vertices on one side of the truth, and keep the noise of single
//! vertices. The best fit evens both out. It is linear in the light, so that layers still sum to the whole.

use glam::DVec3;
use rayon::prelude::*;

use super::limits::Limits;
use super::linear::LightIn;
use super::working::{NONE, Triangle, Working};

/// Iterations of conjugate gradients: the matrix of linear functions on triangles needs no more.
const ITERATIONS: usize = 12;

/// Weight of the values that vertices had, against the light around them.
const OWN: f64 = 0.02;

/// Least squares over the samples of each triangle.
pub struct Fit {
    triangles: Vec<Element>,
    /// Diagonal of the matrix, with the weight of the old values.
    diagonal: Vec<f64>,
    /// Weight of the old values.
    own: Vec<f64>,
    /// Part of the way to the fit that each corner goes.
    part: Vec<f64>,
}

struct Element {
    corners: [u32; 3],
    /// Sums over the samples of weight times products of interpolation weights: of both corners of each edge, then of each corner.
    products: [f64; 6],
    /// Corners that each sample lies between, and its weight times the interpolation weights.
    samples: Vec<([u32; 2], DVec3)>,
}

impl Element {
    fn new(working: &Working, triangle: &Triangle) -> Self {
        let light: LightIn = working.light_in(triangle);
        let mut element = Self { corners: triangle.corners, products: [0.0; 6], samples: vec![] };
        for sample in &triangle.samples {
            let sample = &working.samples[*sample as usize];
            let weights = light.weights(sample.position);
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
}

impl Fit {
    /// The fit of a mesh, no farther from its values than the limits allow, with the fitted values.
    pub fn new(working: &Working, limits: &Limits) -> (Self, Vec<DVec3>) {
        let mut fit = Self {
            triangles: vec![],
            diagonal: vec![0.0; working.corners.len()],
            own: vec![],
            part: vec![1.0; working.corners.len()],
        };
        fit.triangles = working
            .triangles
            .par_iter()
            .filter(|triangle| triangle.corners[0] != NONE)
            .map(|triangle| Element::new(working, triangle))
            .collect();
        for element in &fit.triangles {
            for (corner, product) in element.corners.iter().zip(&element.products[3..]) {
                fit.diagonal[*corner as usize] += product;
            }
        }
        fit.own = fit.diagonal.iter().map(|diagonal| OWN * diagonal + f64::MIN_POSITIVE).collect();
        fit.diagonal.iter_mut().zip(&fit.own).for_each(|(diagonal, own)| *diagonal += own);
        let light: Vec<DVec3> = working.corners.iter().map(|corner| corner.light).collect();
        let change = fit.change(&light);
        for ((part, light), change) in fit.part.iter_mut().zip(&light).zip(&change) {
            let step = light.distance(*light + *change);
            // What no light reaches stays dark: a wall must not leak, not even by rounding.
            let reached = *light != DVec3::ZERO;
            *part = if reached && step > 0.0 { (limits.at(*light) / step).min(1.0) } else { 0.0 };
        }
        let fitted = fit.moved(&light, change);
        (fit, fitted)
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
        // Residual of the values that are there.
        let mut residual: Vec<DVec3> = vec![DVec3::ZERO; values.len()];
        for element in &self.triangles {
            for ([a, b], weights) in &element.samples {
                let value = (values[*a as usize] + values[*b as usize]) / 2.0;
                for (corner, weight) in element.corners.iter().zip(weights.to_array()) {
                    residual[*corner as usize] += value * weight;
                }
            }
        }
        let product = self.times(values, false);
        residual.iter_mut().zip(product).for_each(|(residual, product)| *residual -= product);
        let mut change = vec![DVec3::ZERO; values.len()];
        let precondition = |residual: &[DVec3]| -> Vec<DVec3> {
            residual.iter().zip(&self.diagonal).map(|(residual, diagonal)| *residual / *diagonal).collect()
        };
        let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| *a * *b).sum::<DVec3>();
        let over = |a: DVec3, b: DVec3| DVec3::select(b.cmpgt(DVec3::ZERO), a / b, DVec3::ZERO);
        let mut scaled = precondition(&residual);
        let mut direction = scaled.clone();
        let mut square = dot(&residual, &scaled);
        for _ in 0..ITERATIONS {
            let product = self.times(&direction, true);
            let step = over(square, dot(&direction, &product));
            for (index, product) in product.iter().enumerate() {
                change[index] += step * direction[index];
                residual[index] -= step * *product;
            }
            scaled = precondition(&residual);
            let next = dot(&residual, &scaled);
            let turn = over(next, square);
            direction.iter_mut().zip(&scaled).for_each(|(own, scaled)| *own = *scaled + turn * *own);
            square = next;
        }
        change
    }

    /// The matrix times values, with the weight of the old ones or without.
    fn times(&self, values: &[DVec3], with_own: bool) -> Vec<DVec3> {
        let mut product: Vec<DVec3> = if with_own {
            values.iter().zip(&self.own).map(|(value, own)| *value * *own).collect()
        } else {
            vec![DVec3::ZERO; values.len()]
        };
        for Element { corners, products: [ab, bc, ca, aa, bb, cc], .. } in &self.triangles {
            let [i, j, k] = corners.map(|corner| corner as usize);
            let (a, b, c) = (values[i], values[j], values[k]);
            product[i] += a * *aa + b * *ab + c * *ca;
            product[j] += a * *ab + b * *bb + c * *bc;
            product[k] += a * *ca + b * *bc + c * *cc;
        }
        product
    }
}
