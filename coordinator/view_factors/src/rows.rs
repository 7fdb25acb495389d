//! Rows as a whole: what they sum to, which of them are closed, what is open of the others.

use glam::DVec3;
use kernel::geometry::ConvexPolygon;
use kernel::occluder::Occluder;
use rayon::prelude::*;

use super::closing::close;
use super::element::Element;
use super::{ExchangePair, openness};
use scene::{Facet, Scene};

/// A row counts as closed if no ray leaves the scene and it misses 1 by no more than this many of its standard errors: from four
/// replicates of a pair these are uncertain, with heavy tails.
const CLOSED_WITHIN: f64 = 6.0;

/// It may miss 1 by this much more: the rounding of the file's coordinates.
const CLOSED_ROUNDING: f64 = 1e-6;

/// Open parts of rows up to this are rounding.
const LEAST_OPEN: f64 = 1e-12;

/// A surface, and its row as a whole.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Name of the surface.
    pub name: String,
    /// Area, in squared file units.
    pub area: f64,
    /// Centre of gravity, in the file's coordinates.
    pub centre: DVec3,
    /// Part that arrives on no surface: what the factors lack to 1.
    pub open: f64,
    /// Standard error of the sum of the factors before closing.
    pub standard_error: f64,
    /// What closing added to the sum of the factors; 0 for open rows.
    pub correction: f64,
}

/// Closes the rows of surfaces that see nothing but surfaces, and gives every row its figures. Returns how many were closed.
///
/// A row that misses 1 by more than its errors allow is open even if no ray leaves the scene: it sees the backs of surfaces, which
/// are none, or a gap that the rays missed. Nothing is corrected there. A row of more than 1 is closed in any case: no surface sees more
/// than its hemisphere.
pub fn finish(
    rows: &mut [Row],
    pairs: &mut [ExchangePair],
    elements: &[Element],
    scene: &Scene,
    seed: u64,
) -> usize {
    let sums = |pairs: &[ExchangePair], of: fn(&ExchangePair) -> f64| {
        let mut sums = vec![0.0; rows.len()];
        for pair in pairs {
            sums[pair.from as usize] += of(pair);
            if pair.from != pair.to {
                sums[pair.to as usize] += of(pair);
            }
        }
        sums
    };
    let areas: Vec<f64> = rows.iter().map(|row| row.area).collect();
    let before = sums(pairs, |pair| pair.area);
    let variances = sums(pairs, |pair| pair.variance);
    let all: Vec<ConvexPolygon> = scene.front_facets().map(Facet::polygon).collect();
    let all = Occluder::new(&all);
    let is_closed = |index: usize| {
        let lack = 1.0 - before[index] / areas[index];
        let limit = CLOSED_WITHIN * variances[index].sqrt() / areas[index] + CLOSED_ROUNDING;
        let first = elements.partition_point(|element| (element.surface as usize) < index);
        let own = elements[first..].iter().take_while(|element| element.surface as usize == index);
        lack < 0.0 || lack <= limit && openness::is_closed(&own.collect::<Vec<_>>(), &all, seed, index as u32)
    };
    let closed: Vec<bool> = (0..areas.len()).into_par_iter().map(is_closed).collect();
    close(pairs, &areas, &closed);
    let after = sums(pairs, |pair| pair.area);
    for (index, row) in rows.iter_mut().enumerate() {
        let area = areas[index];
        let lack = 1.0 - after[index] / area;
        row.open = if lack > LEAST_OPEN { lack } else { 0.0 };
        row.standard_error = variances[index].sqrt() / area;
        if closed[index] {
            row.correction = (after[index] - before[index]) / area;
        }
    }
    closed.iter().filter(|closed| **closed).count()
}
