//! Vertices and samples that see more than a hemisphere.
//!
//! The form factors of a point sum to 1 at most. Where they sum to more, since surfaces overlap closer than the geometry can tell
//! or a smooth normal bends far, light would grow at each reflection. What such a vertex receives is scaled down as if its factors
//! summed to 1: then every vertex reflects less than the brightest that it sees, and the solution converges.

use std::borrow::Cow;

use glam::DVec3;
use kernel::row::Row;

use super::slab::Slab;

/// Sums up to this are rounding, and stay as they are.
const LARGEST_SUM: f64 = 1.001;

/// Adds a row to the sums of form factors. Light that passes through its shooter comes from behind it.
pub fn add_to_sums(row: &Row, opacity: f64, sums: &mut [f64]) {
    row.for_each(|receiver, factor| sums[receiver] += f64::from(factor) * opacity);
}

/// Adds several rows, given the opacity of each one's shooter.
pub fn add_slab_to_sums(slab: &Slab, opacity: impl Fn(usize) -> f64 + Sync, sums: &mut [f64]) {
    slab.add(sums, |row, part, mask, factors| {
        let opacity = opacity(row);
        let mut rest = mask;
        for factor in factors {
            part[rest.trailing_zeros() as usize] += f64::from(*factor) * opacity;
            rest &= rest.wrapping_sub(1);
        }
    });
}

/// By what factor each vertex is scaled, or each sample.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Bounds {
    vertices: usize,
    /// Those below 1, by vertex.
    reduced: Vec<(usize, f64)>,
}

impl Bounds {
    /// Adds the next vertices, given the sums of their form factors.
    pub fn add(&mut self, sums: &[f64]) {
        let first = self.vertices;
        let above = sums.iter().enumerate().filter(|(_, sum)| **sum > LARGEST_SUM);
        self.reduced.extend(above.map(|(index, sum)| (first + index, 1.0 / sum)));
        self.vertices += sums.len();
    }

    /// Adds the next vertices as another has them.
    pub fn append(&mut self, next: Self) {
        let first = self.vertices;
        self.reduced.extend(next.reduced.into_iter().map(|(index, factor)| (first + index, factor)));
        self.vertices += next.vertices;
    }

    /// Number of vertices added.
    pub fn vertices(&self) -> usize {
        self.vertices
    }

    /// Number of vertices that are scaled down.
    pub fn count(&self) -> usize {
        self.reduced.len()
    }

    /// Largest sum of a vertex that is scaled down; 0 without one.
    pub fn largest_sum(&self) -> f64 {
        self.reduced.iter().map(|(_, factor)| 1.0 / factor).fold(0.0, f64::max)
    }

    /// Scales the light of consecutive vertices.
    pub fn apply(&self, first: usize, light: &mut [DVec3]) {
        for (vertex, factor) in self.within(first, light.len()) {
            light[vertex] *= factor;
        }
    }

    /// Scales a row over consecutive vertices.
    pub fn row<'a>(&self, first: usize, row: &'a Row) -> Cow<'a, Row> {
        if self.within(first, row.receivers()).next().is_none() {
            return Cow::Borrowed(row);
        }
        let mut factors = row.to_dense();
        for (vertex, factor) in self.within(first, row.receivers()) {
            factors[vertex] = (f64::from(factors[vertex]) * factor) as f32;
        }
        Cow::Owned(Row::new(&factors))
    }

    fn within(&self, first: usize, count: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let place = |vertex: usize| self.reduced.partition_point(|(own, _)| *own < vertex);
        self.reduced[place(first)..place(first + count)]
            .iter()
            .map(move |(vertex, factor)| (vertex - first, *factor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_sums_above_one_are_scaled() {
        let mut bounds = Bounds::default();
        bounds.add(&[1.0, 1.0009]);
        bounds.add(&[2.0, 0.5, 4.0]);
        assert_eq!((bounds.count(), bounds.largest_sum()), (2, 4.0));
        let mut light = [DVec3::ONE; 5];
        bounds.apply(0, &mut light);
        assert_eq!(light.map(|light| light.x), [1.0, 1.0, 0.5, 1.0, 0.25]);
        let row = Row::new(&[0.5; 2]);
        assert!(matches!(bounds.row(0, &row), Cow::Borrowed(_)));
        assert_eq!(*bounds.row(3, &row), Row::new(&[0.5, 0.125]));
    }
}
