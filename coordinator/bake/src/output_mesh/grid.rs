//! Positions by the cell that they lie in, to find those on an edge.

use glam::{DVec3, I64Vec3};
use kernel::geometry::Bounds;

/// Vertices closer than this, relative to the extent, are at one position: two roundings of f32 coordinates.
pub const ONE_POINT: f64 = 2.5e-7;

/// A vertex this close to an edge, relative to the extent, lies on it.
pub const ON_EDGE: f64 = 2.2e-6;

/// A vector as a key: two are the same where all bits are.
pub fn bits(vector: DVec3) -> [u64; 3] {
    vector.to_array().map(f64::to_bits)
}

/// Places by the cell that they lie in.
pub struct Grid {
    low: DVec3,
    cell: f64,
    /// Cells along each axis.
    count: I64Vec3,
    sorted: Vec<(u64, u32)>,
    tolerance: f64,
}

impl Grid {
    /// A grid for edges that a place is on within this distance.
    pub fn new(positions: &[DVec3], tolerance: f64) -> Self {
        let bounds = Bounds::around(positions.iter().copied());
        let extent = bounds.extent().max_element().max(tolerance);
        // Places lie on surfaces, and crowd on small things: most cells hold none, and those there hold few.
        let cell = extent / (4.0 * positions.len() as f64).sqrt().clamp(1.0, 8192.0);
        let low = positions.iter().copied().fold(DVec3::MAX, DVec3::min);
        let count = (bounds.extent() / cell).floor().as_i64vec3() + I64Vec3::ONE;
        let mut grid = Self { low, cell, count, sorted: vec![], tolerance };
        grid.sorted = (0..)
            .zip(positions)
            .map(|(index, position)| (grid.key(((*position - low) / cell).floor().as_i64vec3()), index))
            .collect();
        grid.sorted.sort_unstable();
        grid
    }

    fn key(&self, cell: I64Vec3) -> u64 {
        let cell = cell.clamp(I64Vec3::ZERO, self.count - I64Vec3::ONE);
        ((cell.z * self.count.y + cell.y) * self.count.x + cell.x) as u64
    }

    /// Places inside an edge, with the part of the way from its first end, in order; `margin` from the ends at least.
    pub fn inside(&self, positions: &[DVec3], [from, to]: [DVec3; 2], margin: f64) -> Vec<(u32, f64)> {
        let span = to - from;
        let length = span.length();
        let mut found: Vec<(u32, f64)> = vec![];
        if length <= 2.0 * margin {
            return found;
        }
        let axis = span.abs().max_position();
        let scaled = |value: f64, axis: usize| ((value - self.low[axis]) / self.cell).floor() as i64;
        let (least, most) = (from[axis].min(to[axis]), from[axis].max(to[axis]));
        let (other, third) = ((axis + 1) % 3, (axis + 2) % 3);
        let first = scaled(least - self.tolerance, axis).max(0);
        let last = scaled(most + self.tolerance, axis).min(self.count[axis] - 1);
        for slab in first..=last {
            let border = |slab: i64| self.low[axis] + slab as f64 * self.cell;
            let part = |value: f64| ((value - from[axis]) / span[axis]).clamp(0.0, 1.0);
            let borders = [border(slab) - self.tolerance, border(slab + 1) + self.tolerance];
            let [one, two] = borders.map(|value| from + span * part(value));
            let range = |axis: usize| {
                let low = scaled(one[axis].min(two[axis]) - self.tolerance, axis).max(0);
                let high = scaled(one[axis].max(two[axis]) + self.tolerance, axis).min(self.count[axis] - 1);
                low..=high
            };
            for second in range(other) {
                for last in range(third) {
                    let mut cell = I64Vec3::ZERO;
                    (cell[axis], cell[other], cell[third]) = (slab, second, last);
                    let key = self.key(cell);
                    let start = self.sorted.partition_point(|(own, _)| *own < key);
                    let here = self.sorted[start..].iter().take_while(|(own, _)| *own == key);
                    found.extend(here.filter_map(|(_, place)| {
                        let offset = positions[*place as usize] - from;
                        let along = offset.dot(span) / length;
                        let beside = (offset - span * (along / length)).length();
                        let is_inside = beside <= self.tolerance && along > margin && along < length - margin;
                        is_inside.then_some((*place, along / length))
                    }));
                }
            }
        }
        found.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        found
    }
}
