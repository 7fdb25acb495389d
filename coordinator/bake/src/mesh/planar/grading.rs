//! Points that let triangles grow with the distance from what is small.
//!
//! A square around a region is divided into four, and these again, until each is no larger than any segment near it and the way there
//! together. Segments are split to the size of the squares that they run through, and the squares' middles become points. A
//! Delaunay triangulation of all these has triangles of good shape but in narrow gaps between long segments (after Bern, Eppstein and
//! Gilbert, *Provably Good Mesh Generation*, 1994).

use std::f64::consts::FRAC_1_SQRT_2;

use glam::DVec2;

/// A segment longer than this many sides of the smallest square that it runs through is split.
const LONGEST: f64 = 2.0;

/// Middles nearer to a segment than this part of their square's side are left out.
const NEAREST: f64 = 0.4;

/// Most times that a square is divided.
const MOST_LEVELS: u32 = 20;

/// Most times that a square looks at a segment, for each segment and at least. Long segments among small ones are looked at by all
/// squares: a region with more looks than these is not graded.
const LOOKS_PER_SEGMENT: usize = 256;
const LEAST_LOOKS: usize = 1 << 16;

/// Most splits, for each segment and at least.
const SPLITS_PER_SEGMENT: usize = 8;
const LEAST_SPLITS: usize = 256;

/// Squares, by the size of what lies near them.
pub struct Grading {
    squares: Vec<Square>,
    /// Middles of squares that are far enough from all segments.
    pub points: Vec<DVec2>,
    looks_left: usize,
    splits_left: usize,
}

struct Square {
    centre: DVec2,
    side: f64,
    /// Index of the first of four parts.
    parts: Option<u32>,
}

impl Grading {
    /// For these segments, whose ends must not coincide. Squares get no smaller than `finest`.
    pub fn new(segments: &[[DVec2; 2]], finest: f64) -> Self {
        let ends = || segments.iter().flatten().copied();
        let low = ends().reduce(DVec2::min).unwrap_or_default();
        let high = ends().reduce(DVec2::max).unwrap_or_default();
        let side = (high - low).max_element();
        let root = || Square { centre: low + side / 2.0, side, parts: None };
        let mut grading = Self {
            squares: vec![root()],
            points: vec![],
            looks_left: LEAST_LOOKS.max(LOOKS_PER_SEGMENT * segments.len()),
            splits_left: LEAST_SPLITS.max(SPLITS_PER_SEGMENT * segments.len()),
        };
        let all: Vec<&[DVec2; 2]> = segments.iter().collect();
        if grading.divide(0, &all, finest, MOST_LEVELS).is_none() {
            grading.squares = vec![root()];
            grading.points.clear();
        }
        grading
    }

    /// Divides a square; `around` are the segments no farther from it than its side. `None` where there is too much to look at.
    fn divide(&mut self, index: usize, around: &[&[DVec2; 2]], finest: f64, levels: u32) -> Option<()> {
        let Square { centre, side, .. } = self.squares[index];
        let is_small =
            |segment: &&[DVec2; 2]| segment[0].distance(segment[1]) + distance(centre, segment) < side;
        if levels == 0 || side < 2.0 * finest || !around.iter().any(is_small) {
            if around.iter().all(|segment| distance(centre, segment) > NEAREST * side) {
                self.points.push(centre);
            }
            return Some(());
        }
        self.looks_left = self.looks_left.checked_sub(4 * around.len())?;
        let first = self.squares.len();
        self.squares[index].parts = Some(first as u32);
        let half = side / 2.0;
        for (x, y) in [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)] {
            self.squares.push(Square { centre: centre + half * DVec2::new(x, y), side: half, parts: None });
        }
        for part in first..first + 4 {
            let centre = self.squares[part].centre;
            let reach = half * (1.0 + FRAC_1_SQRT_2);
            let near: Vec<_> =
                around.iter().filter(|segment| distance(centre, segment) < reach).copied().collect();
            self.divide(part, &near, finest, levels - 1)?;
        }
        Some(())
    }

    /// Side of the smallest square that a segment runs through, from a square with this index on.
    fn least_side(&self, index: usize, segment: &[DVec2; 2]) -> f64 {
        let Square { centre, side, parts } = self.squares[index];
        if distance(centre, segment) > side * FRAC_1_SQRT_2 {
            return f64::INFINITY;
        }
        let Some(first) = parts else { return side };
        let of_part = |part: u32| self.least_side((first + part) as usize, segment);
        (0..4).map(of_part).fold(f64::INFINITY, f64::min)
    }

    /// Calls `found` with the points that split a segment, from its first end to its last.
    pub fn split(&mut self, segment: [DVec2; 2], found: &mut impl FnMut(DVec2)) {
        let [from, to] = segment;
        if self.splits_left > 0 && from.distance(to) > LONGEST * self.least_side(0, &segment) {
            self.splits_left -= 1;
            let middle = (from + to) / 2.0;
            self.split([from, middle], found);
            found(middle);
            self.split([middle, to], found);
        }
    }
}

/// Distance of a point from a segment.
fn distance(point: DVec2, [from, to]: &[DVec2; 2]) -> f64 {
    let span = *to - *from;
    let part = ((point - *from).dot(span) / span.length_squared()).clamp(0.0, 1.0);
    point.distance(*from + span * part)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::planar::Axes;
    use crate::mesh::planar::arrangement::Arrangement;
    use crate::mesh::planar::triangles::triangulate;
    use crate::test_scenes::facet;
    use glam::DVec3;
    use scene::Facet;

    const FINEST: f64 = 1.0;

    /// The least angle of each triangle of a ceiling cut along a circle of `count` lines, in degrees.
    fn least_angles(facets: &[Facet], count: usize, radius: f64) -> Vec<f64> {
        let facets: Vec<(u32, &Facet)> = (0..).zip(facets).collect();
        let at = |k: usize| {
            let (sine, cosine) = (std::f64::consts::TAU * k as f64 / count as f64).sin_cos();
            DVec3::new(540.0 + radius * cosine, 400.0 + radius * sine, 0.0)
        };
        let lines: Vec<[DVec3; 2]> = (0..count).map(|k| [at(k), at(k + 1)]).collect();
        let axes = Axes::new(facets[0].1);
        let arrangement = Arrangement::new(&facets, &lines, &axes).unwrap();
        let all = triangulate(&arrangement, &facets, &axes, FINEST).unwrap();
        let least = |corners: [u32; 3]| {
            let [a, b, c] = corners.map(|corner| all.vertices[corner as usize].0);
            let angle =
                |at: DVec2, one: DVec2, other: DVec2| (one - at).angle_to(other - at).abs().to_degrees();
            angle(a, b, c).min(angle(b, c, a)).min(angle(c, a, b))
        };
        all.triangles.iter().map(|triangle| least(triangle.corners)).collect()
    }

    #[test]
    fn triangles_around_a_circle_grow_with_the_distance() {
        let [a, b, c, d] = [[0.0, 0.0, 0.0], [600.0, 0.0, 0.0], [600.0, 500.0, 0.0], [0.0, 500.0, 0.0]];
        let (whole, halves) =
            (vec![facet(0, &[a, b, c, d])], vec![facet(0, &[a, b, c]), facet(0, &[a, c, d])]);
        // The larger circle leaves the ceiling.
        for (facets, radius) in [(&whole, 130.0), (&halves, 130.0), (&whole, 50.0), (&halves, 50.0)] {
            for count in [24, 100] {
                let angles = least_angles(facets, count, radius);
                let thin = angles.iter().filter(|angle| **angle < 20.0).count();
                assert!(angles.iter().all(|angle| *angle > 5.0), "{angles:?}");
                assert!(thin * 8 < angles.len(), "{thin} of {}", angles.len());
                assert!(angles.len() < 12 * count, "{} for {count} lines", angles.len());
            }
        }
    }

    /// The grading of a comb of long segments with crumbs between them, and how often its segments are split.
    fn comb(teeth: usize, crumbs: usize) -> (Grading, usize, usize) {
        let long = (0..teeth).map(|tooth| {
            let y = tooth as f64 / 8.0;
            [DVec2::new(0.0, y), DVec2::new(1000.0, y)]
        });
        let small = (0..crumbs).map(|crumb| {
            let at = DVec2::new(1000.0 * crumb as f64 / crumbs as f64, (crumb % teeth) as f64 / 8.0 + 0.06);
            [at, at + DVec2::new(0.01, 0.0)]
        });
        let segments: Vec<[DVec2; 2]> = long.chain(small).collect();
        let mut grading = Grading::new(&segments, 0.01);
        let mut splits = 0;
        segments.iter().for_each(|segment| grading.split(*segment, &mut |_| splits += 1));
        (grading, splits, segments.len())
    }

    #[test]
    fn what_takes_too_many_looks_is_not_graded() {
        let (grading, splits, _) = comb(2000, 2000);
        assert!(grading.points.is_empty());
        assert_eq!(splits, 0);
    }

    #[test]
    fn splits_are_bounded() {
        let (grading, splits, segments) = comb(1, 1000);
        assert!(!grading.points.is_empty());
        assert_eq!(splits, SPLITS_PER_SEGMENT * segments);
    }
}
