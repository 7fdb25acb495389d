//! Which texels lie between others, so that their light may be the mean of theirs.
//!
//! Lattices of texels lie within each other: every eighth column of every eighth row, then every fourth, every second, and all. A
//! texel of a finer lattice lies in the middle of two or four texels of the next coarser one.

use kernel::replica::Receiver;
use rayon::prelude::*;

use crate::error::Stop;

/// Binary logarithm of the distance between texels of the coarsest lattice. They may miss what is smaller than that: callers, who know
/// the light, look for it.
pub const COARSEST: u32 = 3;

/// Least cosine between the normals of texels that have the same light as their mean.
const LEAST_COSINE: f64 = 0.99;

/// Farthest that a point may lie off the middle of two others, in texels: points are in the middle of what of a texel is covered.
const FARTHEST: f64 = 0.25;

/// Four points around another: the first lies opposite the second, the third opposite the fourth. Where there are two, each is here twice.
pub type Around = [u32; 4];

/// The coarsest lattice that a texel of a page belongs to, as the binary logarithm of the distance between its texels.
pub fn lattice([x, y]: [u32; 2]) -> u32 {
    (x | y).trailing_zeros().min(COARSEST)
}

/// Steps to pairs of opposite texels of the next coarser lattice.
fn pairs([x, y]: [u32; 2], lattice: u32) -> &'static [[[i64; 2]; 2]] {
    match [x, y].map(|place| (place >> lattice) & 1) {
        [1, 1] => &[[[-1, -1], [1, 1]], [[-1, 1], [1, -1]]],
        [1, _] => &[[[-1, 0], [1, 0]]],
        _ => &[[[0, -1], [0, 1]]],
    }
}

/// For each point, given with its texel's place (page, column, row), those around it, if there are any on the same flat or little curved
/// surface: points found `at` places, alike. None where `stop` says so.
pub fn around(
    points: &[(Receiver, [u32; 3])],
    at: impl Fn([u32; 3]) -> Option<u32> + Sync,
    are_alike: impl Fn(u32, u32) -> bool + Sync,
    stop: Stop,
) -> Option<Vec<Option<Around>>> {
    let of_point = |(index, (point, [page, x, y])): (usize, &(Receiver, [u32; 3]))| {
        let lattice = lattice([*x, *y]);
        if lattice == COARSEST {
            return None;
        }
        let step = 1_i64 << lattice;
        let other = |[right, down]: [i64; 2]| {
            let [x, y] =
                [(*x, right), (*y, down)].map(|(place, by)| u32::try_from(i64::from(place) + by * step));
            at([*page, x.ok()?, y.ok()?])
        };
        let holds = |[a, b]: [u32; 2]| {
            let [one, two] = [a, b].map(|other| &points[other as usize].0);
            let apart = one.position.distance(two.position);
            let off = (one.position + two.position).distance(2.0 * point.position) / 2.0;
            let is_even = [one, two].iter().all(|other| other.normal.dot(point.normal) >= LEAST_COSINE);
            is_even
                && off <= FARTHEST * apart / (2 * step) as f64
                && [a, b].iter().all(|other| are_alike(*other, index as u32))
        };
        let found =
            pairs([*x, *y], lattice).iter().filter_map(|[one, two]| Some([other(*one)?, other(*two)?]));
        let mut even = found.filter(|pair| holds(*pair));
        let [a, b] = even.next()?;
        let [c, d] = even.next().unwrap_or([a, b]);
        Some([a, b, c, d])
    };
    let checked = |of: (usize, &_)| if of.0 % 256 == 0 && stop() { None } else { Some(of_point(of)) };
    points.par_iter().enumerate().with_min_len(1024).map(checked).collect()
}
