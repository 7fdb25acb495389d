//! Points at even distances within a box.

use glam::DVec3;
use serde::Serialize;

use crate::error::{MOST_PROBES, ProbeError};

/// A grid of probes along the axes of the file. The first axis runs fastest, then the second.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Grid {
    /// Position of the first probe, units of the file.
    pub origin: [f64; 3],
    /// Distance of neighbours.
    pub spacing: f64,
    /// Number of probes along each axis.
    pub size: [u32; 3],
}

impl Grid {
    /// The grid that fills a box, with what is left over divided between both ends. All probes lie in the box.
    ///
    /// # Errors
    /// When it would have too many probes.
    pub fn filling([low, high]: [DVec3; 2], spacing: f64) -> Result<Self, ProbeError> {
        let counts = |spacing: f64| ((high - low) / spacing).map(|count| count.ceil().max(1.0));
        let along = counts(spacing);
        let probes = along.element_product();
        if probes > MOST_PROBES as f64 {
            let mut least = (high - low).max_element() / MOST_PROBES as f64;
            while counts(least).element_product() > MOST_PROBES as f64 {
                least *= 1.02;
            }
            return Err(ProbeError::TooFine { spacing, probes, least: least * 1.01 });
        }
        let origin = (low + high) / 2.0 - (along - 1.0) * spacing / 2.0;
        Ok(Self { origin: origin.to_array(), spacing, size: along.as_uvec3().to_array() })
    }

    /// The positions of all probes.
    pub fn positions(&self) -> impl Iterator<Item = DVec3> {
        let Self { origin, spacing, size: [width, height, depth] } = *self;
        (0..depth).flat_map(move |z| {
            (0..height).flat_map(move |y| {
                (0..width).map(move |x| DVec3::from(origin) + DVec3::from([x, y, z].map(f64::from)) * spacing)
            })
        })
    }

    /// The probes beside one, corners included.
    pub fn around(&self, probe: usize) -> impl Iterator<Item = usize> {
        let [width, height, depth] = self.size.map(|count| count as usize);
        let [x, y, z] = [probe % width, probe / width % height, probe / (width * height)];
        let near = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
        near(z, depth)
            .flat_map(move |z| near(y, height).map(move |y| (y, z)))
            .flat_map(move |(y, z)| near(x, width).map(move |x| x + width * (y + height * z)))
            .filter(move |other| *other != probe)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_lies_in_the_middle_of_its_box() {
        let grid = Grid::filling([DVec3::ZERO, DVec3::new(2.5, 1.0, 0.0)], 1.0).unwrap();
        assert_eq!(grid.size, [3, 1, 1]);
        let positions: Vec<DVec3> = grid.positions().collect();
        assert_eq!(
            positions,
            [0.25, 1.25, 2.25].map(|x| DVec3::new(x, 0.5, 0.0)),
            "a flat box has one layer"
        );
    }

    #[test]
    fn neighbours_are_those_at_a_cells_distance() {
        let grid = Grid::filling([DVec3::ZERO, DVec3::new(4.0, 3.0, 2.0)], 1.0).unwrap();
        let positions: Vec<DVec3> = grid.positions().collect();
        for probe in 0..positions.len() {
            let near: Vec<usize> = grid.around(probe).collect();
            let is_near = |other: &usize| {
                *other != probe && (positions[*other] - positions[probe]).abs().max_element() < 1.5
            };
            assert_eq!(near, (0..positions.len()).filter(is_near).collect::<Vec<_>>());
        }
    }

    #[test]
    fn too_fine_a_grid_is_refused_with_one_that_is_not() {
        let space = [DVec3::ZERO, DVec3::new(10.0, 3.0, 0.2)];
        let Err(ProbeError::TooFine { probes, least, .. }) = Grid::filling(space, 1e-3) else {
            panic!("accepted")
        };
        assert!(probes > 5e6);
        let grid = Grid::filling(space, least).unwrap();
        let count = grid.size.iter().product::<u32>() as usize;
        assert!(count <= MOST_PROBES && count > MOST_PROBES / 2, "{count}");
    }
}
