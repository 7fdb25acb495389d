//! Rays through the tree, on every kind of processor, against each triangle by itself in f64.

use glam::DVec3;
use proptest::prelude::*;
use pulp::WithSimd;

use super::polygons::{GRAZING, Hit, SeenPolygons};
use crate::geometry::{ConvexPolygon, PlaneId};

/// One answer, whatever computes it.
fn nearest(polygons: &SeenPolygons, origin: DVec3, direction: DVec3, from: f64, own: PlaneId) -> Option<Hit> {
    let found = polygons.nearest(origin, direction, from, own);
    let mut met = polygons.met();
    polygons.ray([&origin, &direction], from, own, &mut met).with_simd(pulp::Scalar);
    let portable = polygons.first_of(&met, direction);
    let one_by_one = one_by_one(polygons, origin, direction, from, own);
    assert_eq!(found, one_by_one, "{origin} along {direction} from {from}");
    assert_eq!(portable, one_by_one, "{origin} along {direction} from {from}, lane by lane");
    found
}

fn one_by_one(
    polygons: &SeenPolygons,
    origin: DVec3,
    direction: DVec3,
    from: f64,
    own: PlaneId,
) -> Option<Hit> {
    let from = if from > 0.0 { from + polygons.clearance } else { 0.0 };
    let others = polygons.triangles.iter().filter(|triangle| triangle.plane != own);
    let mut hits: Vec<(Hit, f64)> = others
        .filter_map(|triangle| {
            let distance = triangle.distance(origin, direction).filter(|distance| *distance > from)?;
            let cosine = triangle.normal.dot(direction);
            let (polygon, plane) = (triangle.polygon as usize, triangle.plane);
            let hit = Hit { polygon, distance, is_front: cosine < 0.0, plane };
            Some((hit, polygons.clearance / cosine.abs().max(GRAZING)))
        })
        .collect();
    hits.sort_by(|(a, _), (b, _)| a.distance.total_cmp(&b.distance).then(a.polygon.cmp(&b.polygon)));
    let nearest = hits.first()?.0;
    let is_of_its_sheet =
        |hit: &Hit, sheet: f64| hit.plane == nearest.plane && hit.distance - nearest.distance <= sheet;
    let front = hits.iter().find(|(hit, sheet)| hit.is_front && is_of_its_sheet(hit, *sheet));
    Some(front.map_or(nearest, |(hit, _)| if nearest.is_front { nearest } else { *hit }))
}

fn polygon(plane: u32, corners: &[DVec3]) -> ConvexPolygon {
    ConvexPolygon { plane: PlaneId(plane), corners: corners.to_vec() }
}

fn point(reach: f64) -> impl Strategy<Value = DVec3> {
    (-reach..reach, -reach..reach, -reach..reach).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

/// Small and large triangles, slivers among them, some with another side a hair apart.
fn polygons() -> impl Strategy<Value = Vec<ConvexPolygon>> {
    let triangle = (point(1000.0), point(1.0), point(1.0), -3.0..2.7_f64, 0.0..1.0_f64, 0..3);
    let sides = triangle.prop_map(|(at, b, c, size, width, sides)| {
        let size = 10_f64.powf(size);
        let corners = [at, at + b * size, at + c * (size * width.powi(6))];
        let apart = b.cross(c).normalize_or_zero() * 5e-4;
        (corners, [corners[0] + apart, corners[2] + apart, corners[1] + apart], sides)
    });
    prop::collection::vec(sides, 1..120).prop_map(|all| {
        let of_one = |(plane, (front, back, sides)): (u32, ([DVec3; 3], [DVec3; 3], i32))| {
            let mut both = vec![polygon(plane, &front), polygon(plane, &back)];
            both.truncate(if sides == 0 { 2 } else { 1 });
            both
        };
        (0..).zip(all).flat_map(of_one).collect()
    })
}

proptest! {
    #[test]
    fn rays_meet_first_what_they_meet_one_by_one(
        polygons in polygons(), origins in prop::collection::vec((point(1200.0), point(1.0)), 1..4)
    ) {
        let seen = SeenPolygons::new(&polygons, &[]);
        for (origin, along) in origins {
            nearest(&seen, origin, along.normalize(), 0.0, PlaneId::NONE);
            for polygon in &polygons {
                // Through inner points, corners and middles of edges, from afar and from within another triangle.
                let [a, b, c] = [0, 1, 2].map(|corner| polygon.corners[corner]);
                for target in [(a + b + c) / 3.0, a, (a + b) * 0.5] {
                    let direction = (target - origin).normalize();
                    let first = nearest(&seen, origin, direction, 0.0, PlaneId::NONE);
                    if let Some(first) = first {
                        nearest(&seen, origin, direction, first.distance, PlaneId::NONE);
                        nearest(&seen, origin, direction, 0.0, first.plane);
                    }
                    let start = polygons[0].corners.iter().sum::<DVec3>() / 3.0;
                    if let Some(direction) = (target - start).try_normalize() {
                        nearest(&seen, start, direction, 0.0, polygons[0].plane);
                    }
                    // Nearly along the triangle.
                    let grazing = ((b - a).normalize_or_zero() + along * 1e-6).normalize();
                    nearest(&seen, target - grazing * 300.0, grazing, 0.0, PlaneId::NONE);
                }
            }
        }
    }
}

#[test]
fn a_ray_of_no_numbers_meets_nothing() {
    let square = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
    let seen = SeenPolygons::new(&[polygon(0, &square)], &[]);
    let aim = DVec3::new(0.4, 0.3, 0.0) - DVec3::Z;
    assert!(nearest(&seen, DVec3::Z, aim.normalize(), 0.0, PlaneId::NONE).is_some());
    assert_eq!(nearest(&seen, DVec3::Z, DVec3::NAN, 0.0, PlaneId::NONE), None);
    assert_eq!(nearest(&seen, DVec3::new(0.3, f64::NAN, 1.0), DVec3::NEG_Z, 0.0, PlaneId::NONE), None);
}
