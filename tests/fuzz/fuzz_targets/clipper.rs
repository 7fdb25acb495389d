//! Clipping makes no area, and the two sides of a cut are the whole. What is left of a polygon behind a blocker, with what the
//! blocker hides, is the whole too.
#![no_main]

use arbitrary::Arbitrary;
use glam::DVec3;
use kernel::geometry::{Corners, area_vector, clip, clip_by_plane};
use kernel::visibility::{Cones, Pieces, cut};
use libfuzzer_sys::fuzz_target;

/// A convex polygon: an ellipse through some points around a centre.
#[derive(Arbitrary, Debug)]
struct Shape {
    centre: [i16; 3],
    axes: [[i16; 3]; 2],
    corners: u8,
    /// Powers of two by which the axes are shorter.
    shrink: [u8; 2],
}

#[derive(Arbitrary, Debug)]
struct Input {
    polygon: Shape,
    plane: [i16; 3],
    blockers: Vec<Shape>,
    /// Heights of the corners over a cut that need not be a plane's.
    heights: Vec<i16>,
}

/// Sums of areas, relative to the whole.
const ROUNDING: f64 = 1e-9;

/// Corners move by this part of their distance from the origin at most: the clipper makes one of corners that are 1e-12 apart, and
/// a polygon is clipped at up to 48 planes here.
const MOVED: f64 = 1e-11;

fn vector(numbers: [i16; 3]) -> DVec3 {
    DVec3::from_array(numbers.map(f64::from)) / 32.0
}

impl Shape {
    /// Counter-clockwise seen from the origin; none without an area to speak of.
    fn corners(&self) -> Option<Corners> {
        let axis = |i: usize| vector(self.axes[i]) * 2.0_f64.powi(-i32::from(self.shrink[i] % 24));
        let (centre, u, v) = (vector(self.centre), axis(0), axis(1));
        let count = 3 + u32::from(self.corners % 6);
        let corners: Corners = (0..count)
            .map(|i| {
                let (sine, cosine) = (std::f64::consts::TAU * f64::from(i) / f64::from(count)).sin_cos();
                centre + u * cosine + v * sine
            })
            .collect();
        let area = area_vector(&corners);
        // A polygon that the origin sees edge-on has no sides to speak of.
        let height = area.normalize_or_zero().dot(centre).abs();
        let reach = corners.iter().map(|corner| corner.length()).fold(0.0, f64::max);
        // Nor has a speck whose coordinates are rounding.
        let longest = u.length().max(v.length());
        let is_speck = area.length() <= 1e-6 * longest * longest.max(1e-3 * reach);
        let is_sound = !is_speck && height > 1e-3 * reach;
        let turned = area.dot(centre) > 0.0;
        is_sound.then(|| if turned { corners.iter().rev().copied().collect() } else { corners })
    }
}

fn area(corners: &[DVec3]) -> f64 {
    area_vector(corners).length()
}

fuzz_target!(|input: Input| {
    let Some(polygon) = input.polygon.corners() else { return };
    let whole = area(&polygon);
    let next = polygon.iter().cycle().skip(1);
    let outline: f64 = polygon.iter().zip(next).map(|(a, b)| a.distance(*b)).sum();
    let reach = polygon.iter().map(|corner| corner.length()).fold(0.0, f64::max);
    let slack = ROUNDING * whole + MOVED * reach * outline;

    let normal = vector(input.plane);
    let (above, below) = (clip_by_plane(&polygon, normal), clip_by_plane(&polygon, -normal));
    for part in [&above, &below] {
        assert!(part.iter().all(|corner| corner.is_finite()));
        assert!(area(part) <= whole + slack, "{} of {whole}", area(part));
    }
    if polygon.iter().any(|corner| normal.dot(*corner) != 0.0) {
        let sum = area(&above) + area(&below);
        assert!((sum - whole).abs() <= slack, "{sum} of {whole}");
    }
    let heights: Vec<f64> =
        (0..polygon.len()).map(|i| f64::from(*input.heights.get(i).unwrap_or(&1))).collect();
    let part = clip(&polygon, &heights);
    assert!(part.is_empty() || part.len() >= 3);
    assert!(part.iter().all(|corner| corner.is_finite()));

    let (mut pieces, mut scratch, mut cones) = (Pieces::default(), Pieces::default(), Cones::default());
    pieces.push(&polygon);
    let mut left = whole;
    for blocker in input.blockers.iter().take(6).filter_map(Shape::corners) {
        let hidden: f64 = pieces.iter().map(|piece| area(&hidden_part(piece, &blocker))).sum();
        cones.clear();
        cones.push_polygon(&blocker);
        for cone in cones.iter() {
            cut(&mut pieces, cone, &mut scratch);
        }
        let now: f64 = pieces.iter().map(area).sum();
        assert!(now <= left + slack, "{now} left of {left}");
        assert!((now + hidden - left).abs() <= slack, "{now} left and {hidden} hidden of {left}");
        left = now;
    }
});

/// What of a piece lies in the cone through a blocker, by clipping with the cone's sides one by one.
fn hidden_part(piece: &[DVec3], blocker: &Corners) -> Corners {
    let next = blocker.iter().cycle().skip(1);
    blocker.iter().zip(next).fold(Corners::from(piece), |inside, (a, b)| clip_by_plane(&inside, b.cross(*a)))
}
