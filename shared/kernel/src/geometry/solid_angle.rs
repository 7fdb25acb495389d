//! Points of a polygon that are even over the solid angle at which it is seen. Of those even over its area few would be near a place next
//! to it, and most of its light comes from there.

use glam::DVec3;
// The platform's functions may differ in the last bit between the machines of a cluster.
use libm::{atan2, sincos};
use smallvec::SmallVec;

/// Smaller solid angles are rounding, or nearly so.
const LEAST: f64 = 1e-6;

/// A polygon as a point sees it: triangles on the unit sphere.
pub struct SeenPolygon {
    triangles: SmallVec<[SeenTriangle; 4]>,
    /// Largest distance of a corner.
    farthest: f64,
    /// Height of the point over the polygon's plane, and its normal.
    height: f64,
    normal: DVec3,
}

/// A triangle of unit vectors.
struct SeenTriangle {
    a: DVec3,
    b: DVec3,
    /// From `a` to its third corner along the sphere, at a right angle to `a`: a unit vector.
    to_c: DVec3,
    /// The angle at `a`, with its sine and cosine.
    angle: f64,
    sine: f64,
    cosine: f64,
    /// Solid angle of the polygon's triangles before this one.
    before: f64,
    /// The same with this one.
    end: f64,
}

impl SeenTriangle {
    fn new([a, b, c]: [DVec3; 3], before: f64) -> Self {
        let [to_b, to_c] = [b, c].map(|corner| (corner - a * corner.dot(a)).normalize_or_zero());
        let (sine, cosine) = (to_b.cross(to_c).length(), to_b.dot(to_c));
        let end = before + solid_angle(a, b, c);
        Self { a, b, to_c, angle: atan2(sine, cosine), sine, cosine, before, end }
    }
}

impl SeenPolygon {
    /// A convex polygon with its unit normal. `None` where the point is not in front of it, or sees it so small that its solid angle is
    /// rounding.
    #[must_use]
    pub fn new(position: DVec3, corners: &[DVec3], normal: DVec3) -> Option<Self> {
        let relative = || corners.iter().map(|corner| *corner - position);
        let farthest = relative().map(DVec3::length).fold(0.0, f64::max);
        let height = normal.dot(position - corners[0]);
        let corners: SmallVec<[DVec3; 8]> = relative().map(DVec3::normalize_or_zero).collect();
        let mut end = 0.0;
        let triangles: SmallVec<[SeenTriangle; 4]> = corners[1..]
            .windows(2)
            .map(|pair| {
                let triangle = SeenTriangle::new([corners[0], pair[0], pair[1]], end);
                end = triangle.end;
                triangle
            })
            .collect();
        (end > LEAST && height > 0.0).then_some(Self { triangles, farthest, height, normal })
    }

    /// Its solid angle.
    #[must_use]
    pub fn solid_angle(&self) -> f64 {
        self.triangles[self.triangles.len() - 1].end
    }

    /// Maps the unit square to the polygon, uniformly over the solid angle: the way to a point of it; `None` where rounding leaves none.
    ///
    /// J. Arvo, Stratified sampling of spherical triangles, SIGGRAPH 1995.
    #[must_use]
    pub fn way(&self, x: f64, y: f64) -> Option<DVec3> {
        let wanted = x * self.solid_angle();
        let place = self.triangles.partition_point(|triangle| triangle.end <= wanted);
        let SeenTriangle { a, b, to_c, angle, sine, cosine, before, .. } =
            self.triangles[place.min(self.triangles.len() - 1)];
        // The triangle of a, b and a point between a and c that has this part of the solid angle.
        let turn = wanted - before - angle;
        let (s, t) = sincos(turn);
        let (u, v) = (t - cosine, s + sine * a.dot(b));
        let q = ((v * t - u * s) * cosine - v) / ((v * s + u * t) * sine);
        let q = q.clamp(-1.0, 1.0);
        let on_side = a * q + to_c * (1.0 - q * q).sqrt();
        // A point between that and b.
        let z = 1.0 - y * (1.0 - on_side.dot(b));
        let across = (on_side - b * on_side.dot(b)).normalize_or_zero();
        let way = b * z + across * (1.0 - z * z).max(0.0).sqrt();
        // Rounding may let it pass the polygon.
        let distance = self.height / -self.normal.dot(way);
        (distance > 0.0).then(|| way * distance.min(self.farthest)).filter(|way| way.is_finite())
    }
}

/// Solid angle of a triangle of unit vectors.
///
/// A. van Oosterom and J. Strackee, The solid angle of a plane triangle, 1983.
fn solid_angle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let volume = a.dot(b.cross(c)).abs();
    2.0 * atan2(volume, 1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use proptest::prelude::*;
    use sobol_burley::sample_4d;

    use super::*;
    use crate::form_factor::point_to_polygon;

    const DRAWS: u32 = 4096;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// The mean of the cosines over a solid angle is the form factor, in a plane too that is not even with the axes.
        #[test]
        fn points_are_even_over_the_solid_angle(
            count in 3_usize..8,
            flat in 0.05..1.0,
            across in -1.5..1.5,
            along in -1.5..1.5,
            height in -3.0..1.0,
        ) {
            let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -0.4, 0.3);
            let corner = |index| {
                let angle = TAU * index as f64 / count as f64;
                turn * DVec3::new(angle.cos(), flat * angle.sin(), 0.0) + DVec3::splat(3.0)
            };
            let corners: Vec<DVec3> = (0..count).map(corner).collect();
            let normal = turn * DVec3::Z;
            let height = 10f64.powf(height);
            let position = turn * DVec3::new(across, along, height) + DVec3::splat(3.0);
            let Some(seen) = SeenPolygon::new(position, &corners, normal) else {
                prop_assert!(height < 1e-2 || flat < 0.1);
                return Ok(());
            };
            let ways: Vec<DVec3> = (0..DRAWS)
                .map(|index| {
                    let [x, y, ..] = sample_4d(index, 0, 7).map(f64::from);
                    seen.way(x, y).unwrap()
                })
                .collect();
            for way in &ways {
                let place = turn.inverse() * (position + *way - DVec3::splat(3.0));
                prop_assert!(place.z.abs() < 1e-6, "{} is no place of the plane", place);
                prop_assert!(place.x.abs() < 1.0 + 1e-6 && place.y.abs() < flat + 1e-6, "{} is outside", place);
            }
            for looking in [-normal, turn * DVec3::new(0.6, 0.0, -0.8)] {
                let cosines: f64 = ways.iter().map(|way| way.normalize().dot(looking).max(0.0)).sum();
                let found = cosines / f64::from(DRAWS) * seen.solid_angle() / PI;
                let exact = point_to_polygon(position, looking, &corners);
                prop_assert!((found - exact).abs() < 2e-3 + 5e-3 * exact, "{} for {}", found, exact);
            }
        }
    }

    /// Corners on a straight line, and twice at one place, make triangles without a solid angle: no point is on them.
    #[test]
    fn corners_may_be_of_no_use() {
        let corners = [[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 1.0]]
            .map(|[x, y]| DVec3::new(x, y, 0.0));
        let position = DVec3::new(0.4, 0.9, 0.2);
        let seen = SeenPolygon::new(position, &corners, DVec3::Z).unwrap();
        let mut cosines = 0.0;
        for index in 0..DRAWS {
            let [x, y, ..] = sample_4d(index, 0, 3).map(f64::from);
            let at = position + seen.way(x, y).unwrap();
            assert!(at.z.abs() < 1e-9 && at.min_element() > -1e-9 && at.max_element() < 2.0 + 1e-9, "{at}");
            cosines += 0.2 / (at - position).length() / f64::from(DRAWS);
        }
        let exact = point_to_polygon(position, DVec3::NEG_Z, &corners);
        assert!((cosines * seen.solid_angle() / PI - exact).abs() < 2e-3, "{cosines}");
    }

    #[test]
    fn from_behind_and_edge_on_nothing_is_seen() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        assert!(SeenPolygon::new(DVec3::new(0.2, 0.2, -0.5), &corners, DVec3::Z).is_none());
        assert!(SeenPolygon::new(DVec3::new(3.0, 0.5, 1e-9), &corners, DVec3::Z).is_none());
        assert!(SeenPolygon::new(DVec3::ZERO, &corners, DVec3::Z).is_none());
        let half = SeenPolygon::new(DVec3::new(0.25, 0.25, 1e-6), &corners, DVec3::Z).unwrap();
        assert!((half.solid_angle() - TAU).abs() < 1e-4, "{}", half.solid_angle());
    }
}
