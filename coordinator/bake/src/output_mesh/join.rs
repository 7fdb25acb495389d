//! Joins both sides of contact lines with the same light.

use rayon::prelude::*;

use super::grid::bits;
use super::limits::Limits;
use super::working::{Corner, Working};

/// Part of the limit by which the values of both sides may differ. Each moves by half of it.
const ALIKE: f64 = 0.5;

/// Joins corners of one region at one position whose light is alike: a contact line that shows in nothing ends there.
pub fn join(working: &mut Working, limits: &Limits) {
    let key = |(index, corner): (usize, &Corner)| {
        let index = index as u32;
        let is_open = corner.around.iter().any(|triangle| {
            let others = working.triangles[*triangle as usize].corners.into_iter().filter(|c| *c != index);
            others.into_iter().any(|other| working.along(index, other).count() == 1)
        });
        let first = corner.around.first().filter(|_| is_open)?;
        let region = working.triangles[*first as usize].region;
        Some(((region, bits(corner.position)), index))
    };
    let corners = working.corners.par_iter().enumerate().with_min_len(256);
    let mut open: Vec<((u32, [u64; 3]), u32)> = corners.filter_map(key).collect();
    open.par_sort_unstable();
    for together in open.chunk_by(|a, b| a.0 == b.0) {
        let (_, kept) = together[0];
        for (_, other) in &together[1..] {
            let [one, two] = [kept, *other].map(|corner| &working.corners[corner as usize]);
            let is_alike = one.light.distance(two.light) <= ALIKE * limits.at(one.light.min(two.light));
            if is_alike && one.normal == two.normal {
                working.merge(kept, *other);
            }
        }
    }
}

impl Working {
    /// Makes a corner another one's; the first of them brings the mean.
    fn merge(&mut self, kept: u32, other: u32) {
        let gone = self.corners[other as usize].clone();
        for triangle in &gone.around {
            let corners = &mut self.triangles[*triangle as usize].corners;
            corners.iter_mut().filter(|corner| **corner == other).for_each(|corner| *corner = kept);
        }
        let corner = &mut self.corners[kept as usize];
        if corner.from.1 == 0.0 {
            corner.light = (corner.light + gone.light) / 2.0;
            corner.from = ([corner.from.0[0], gone.from.0[0]], 0.5);
        }
        corner.around.extend(gone.around);
        self.corners[other as usize].around.clear();
    }
}
