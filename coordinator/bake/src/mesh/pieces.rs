//! Facets cut into pieces: along few lines, and across where they are long and thin.

use glam::DVec3;
use kernel::geometry::area_vector;
use rayon::prelude::*;

use super::WELD;
use super::line::Contact;
use scene::{Corner, Facet};

/// Pieces more elongated than this are cut across before they are divided about their centre, which keeps proportions.
const LONGEST_PROPORTION: f64 = 2.0;

/// The same for pieces that are shorter than the longest edge of a patch: legs and frames, whose ends lie in corners and say nothing of
/// the light between.
const LONGEST_OF_SMALL: f64 = 4.0;

/// Length of the shortest pieces that are cut, relative to the longest edge of a patch.
const SHORTEST: f64 = 0.125;

/// Cuts a convex facet along lines. A cut goes on to the border of the piece that it starts in, so that all pieces stay
/// convex.
pub fn cut_along(corners: Vec<Corner>, normal: DVec3, lines: &[Contact]) -> Vec<Vec<Corner>> {
    let mut pieces = vec![corners];
    for [start, end] in lines {
        let across = (*end - *start).cross(normal).normalize_or_zero();
        let mut cut = vec![];
        for piece in pieces {
            let heights: Vec<f64> =
                piece.iter().map(|corner| snapped(across.dot(corner.position - *start))).collect();
            let crossed = heights.iter().any(|h| *h > 0.0) && heights.iter().any(|h| *h < 0.0);
            if crossed && overlap(&piece, &heights, *start, *end) {
                cut.extend(split(&piece, &heights, normal));
            } else {
                cut.push(piece);
            }
        }
        pieces = cut;
    }
    pieces
}

/// True when the contact runs through a piece that its line crosses, rather than only its extension.
fn overlap(piece: &[Corner], heights: &[f64], start: DVec3, end: DVec3) -> bool {
    let along = (end - start).normalize_or_zero();
    let crossings = (0..piece.len()).filter_map(|i| {
        let next = (i + 1) % piece.len();
        if heights[i] == 0.0 {
            Some(along.dot(piece[i].position - start))
        } else if heights[i] * heights[next] < 0.0 {
            let t = heights[i] / (heights[i] - heights[next]);
            Some(along.dot(piece[i].position.lerp(piece[next].position, t) - start))
        } else {
            None
        }
    });
    let (low, high) = crossings.fold((f64::MAX, f64::MIN), |(low, high), s| (low.min(s), high.max(s)));
    high.min(end.distance(start)) - low.max(0.0) > 4.0 * WELD
}

/// Which pieces are cut.
#[derive(Debug, Clone, Copy)]
pub struct Lengths {
    /// Longest edge of a patch.
    pub longest: f64,
    /// Pieces up to this length stay whole, however thin.
    pub shortest: f64,
}

impl Lengths {
    /// Whether a piece is long and thin.
    fn is_long(&self, length: f64, area: f64) -> bool {
        let proportion = if length > self.longest { LONGEST_PROPORTION } else { LONGEST_OF_SMALL };
        length > self.shortest.max(4.0 * WELD) && length * length > proportion * area
    }
}

/// The lengths that cut, of the facets shorter than the longest edge of a patch, the longest `most`.
pub fn lengths<'a>(facets: impl ParallelIterator<Item = &'a Facet>, longest: f64, most: usize) -> Lengths {
    let shortest = longest * SHORTEST;
    let all = Lengths { longest, shortest };
    let mut cut: Vec<f64> = facets
        .filter_map(|facet| {
            let positions: Vec<DVec3> = facet.positions().collect();
            let (_, low, high) = extent(&positions);
            let length = high - low;
            (length <= longest && all.is_long(length, area_vector(&positions).length())).then_some(length)
        })
        .collect();
    if cut.len() <= most {
        return all;
    }
    cut.sort_by(|a, b| b.total_cmp(a));
    Lengths { longest, shortest: cut[most] }
}

/// Cuts a convex polygon across its longest side until it is short or of fair proportions.
pub fn cut_long(corners: Vec<Corner>, normal: DVec3, lengths: Lengths, done: &mut impl FnMut(Vec<Corner>)) {
    let positions: Vec<DVec3> = corners.iter().map(|corner| corner.position).collect();
    let area = area_vector(&positions).length();
    let (along, low, high) = extent(&positions);
    if !lengths.is_long(high - low, area) {
        done(corners);
        return;
    }
    let middle = (low + high) / 2.0;
    let heights: Vec<f64> = along.iter().map(|s| snapped(s - middle)).collect();
    for half in split(&corners, &heights, normal) {
        cut_long(half, normal, lengths, done);
    }
}

/// A height over a cut; corners within the welding distance lie on it.
fn snapped(height: f64) -> f64 {
    if height.abs() <= WELD { 0.0 } else { height }
}

/// Place of each corner along the longest side, with the least and the largest. Along that side rather than the diagonal, so that
/// rectangles are cut into rectangles.
fn extent(positions: &[DVec3]) -> (Vec<f64>, f64, f64) {
    let direction = longest_side(positions).normalize_or_zero();
    let along: Vec<f64> = positions.iter().map(|position| direction.dot(*position)).collect();
    let (low, high) = along.iter().fold((f64::MAX, f64::MIN), |(low, high), s| (low.min(*s), high.max(*s)));
    (along, low, high)
}

fn longest_side(positions: &[DVec3]) -> DVec3 {
    let next = positions.iter().cycle().skip(1);
    let sides = positions.iter().zip(next).map(|(a, b)| *b - *a);
    sides.fold(
        DVec3::ZERO,
        |longest, side| {
            if side.length_squared() > longest.length_squared() { side } else { longest }
        },
    )
}

/// Both parts of a convex polygon that a line crosses, given the height of each corner over the line: above, then below. New
/// corners take the mean of their neighbours' normals.
fn split(corners: &[Corner], heights: &[f64], facet_normal: DVec3) -> [Vec<Corner>; 2] {
    let mut parts = [vec![], vec![]];
    for (i, corner) in corners.iter().enumerate() {
        let next = (i + 1) % corners.len();
        if heights[i] >= 0.0 {
            parts[0].push(*corner);
        }
        if heights[i] <= 0.0 {
            parts[1].push(*corner);
        }
        if heights[i] * heights[next] < 0.0 {
            let t = heights[i] / (heights[i] - heights[next]);
            let flat = corner.normal == facet_normal && corners[next].normal == facet_normal;
            let normal = corner.normal.lerp(corners[next].normal, t);
            let cut = Corner {
                position: corner.position.lerp(corners[next].position, t),
                normal: if flat { facet_normal } else { normal.normalize_or(facet_normal) },
            };
            parts.iter_mut().for_each(|part| part.push(cut));
        }
    }
    parts
}
