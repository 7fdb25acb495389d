//! Integration over a convex polygon by a product rule.

use std::borrow::Cow;

use glam::DVec3;
use kernel::form_factor::{AreaPoint, area_points};
use kernel::geometry::{Corners, area_vector};

/// Most nodes in each direction of a polygon.
const MOST_NODES: usize = 8;

/// Rules with up to this many nodes are kept with the polygon.
const KEPT_RULES: usize = 4;

/// How far into the complex plane the kernel is bounded, relative to the distance of the polygons.
const REACH: f64 = 0.4;

/// A polygon as a place to integrate over.
pub struct Quadrature {
    pub(crate) normal: DVec3,
    pub(crate) area: f64,
    pub(crate) centre: DVec3,
    pub(crate) radius: f64,
    /// Half of the longest segment along which a parameter moves a point.
    half: f64,
    /// Mean of the largest and the smallest density of the parameters, relative to that of the whole, and half of their
    /// difference: 1 and 0 for a parallelogram.
    density: [f64; 2],
    corners: Corners,
    rules: Vec<Vec<AreaPoint>>,
}

impl Quadrature {
    /// Of a convex polygon.
    #[must_use]
    pub fn new(corners: &[DVec3]) -> Self {
        let whole = area_vector(corners);
        let area = whole.length();
        let centre = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let radius = corners.iter().map(|corner| corner.distance(centre)).fold(0.0, f64::max);
        let end = corners.len() - 1;
        let (mut longest, mut density) = (0.0, [1.0_f64, 0.0_f64]);
        for first in (1..end).step_by(2) {
            let quad = [corners[0], corners[first], corners[first + 1], corners[(first + 2).min(end)]];
            let next = |i: usize| quad[(i + 1) % 4] - quad[i];
            let part = 0.5 * (quad[2] - quad[0]).cross(quad[3] - quad[1]).length();
            let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
            for corner in 0..4 {
                longest = f64::max(longest, next(corner).length());
                let here = next((corner + 3) % 4).cross(next(corner)).length() / part;
                (low, high) = (low.min(here), high.max(here));
            }
            density[0] = density[0].max(0.5 * (high + low));
            density[1] = density[1].max(0.5 * (high - low));
        }
        Self {
            normal: whole.normalize_or_zero(),
            area,
            centre,
            radius,
            half: 0.5 * longest,
            density,
            corners: corners.iter().copied().collect(),
            rules: vec![],
        }
    }

    /// Of a convex polygon that has many pairs.
    #[must_use]
    pub fn with_rules(corners: &[DVec3]) -> Self {
        let rules = (1..=KEPT_RULES).map(|nodes| area_points(corners, nodes)).collect();
        Self { rules, ..Self::new(corners) }
    }

    /// Nodes in each direction with which the integral over this polygon is off by no more than `wanted`, relative to that of
    /// 1 / (pi distance^2); `None` if that takes too many.
    ///
    /// A function that is analytic, and at most M, in the ellipse around an interval whose half axes add up to rho half lengths
    /// has Chebyshev coefficients of at most 2 M rho^-k. Gauss's rule with n nodes is exact up to degree 2n - 1 and misses the
    /// mean of every even polynomial beyond by 4/3 at most: together 8/3 M rho^(-2n) / (1 - rho^-2). A parameter moves the
    /// point by up to d = `REACH` times the distance r into the complex plane, if rho - 1/rho is 2 d / half length. There the
    /// kernel's scalar products are at most (r + d)^2 together, and the squared distance is at least (r - d)^2. Two parameters
    /// double the bound.
    pub(crate) fn nodes(&self, distance: f64, wanted: f64) -> Option<usize> {
        let lift = REACH * distance / self.half;
        let rho = lift + (lift * lift + 1.0).sqrt();
        let square = rho * rho;
        let kernel = (1.0 + REACH) * (1.0 + REACH) / ((1.0 - REACH) * (1.0 - REACH)).powi(2);
        let density = self.density[0] + self.density[1] * 0.5 * (rho + 1.0 / rho);
        let mut bound = 2.0 * (8.0 / 3.0) * kernel * density / (1.0 - 1.0 / square);
        for nodes in 1..=MOST_NODES {
            bound /= square;
            if bound <= wanted {
                return Some(nodes);
            }
        }
        None
    }

    pub(crate) fn points(&self, nodes: usize) -> Cow<'_, [AreaPoint]> {
        match self.rules.get(nodes - 1) {
            Some(points) => points.into(),
            None => area_points(&self.corners, nodes).into(),
        }
    }
}
