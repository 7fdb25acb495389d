//! Form factors against the cases of `form_factors.json`.
//!
//! Tolerances: 1e-12 relative for tame cases, 1e-15 absolute for hard ones in f64; the prepared polygons that rows are made of
//! are held to 1e-9 relative where they are far and to the same figures elsewhere.

use glam::DVec3;
use shared::form_factor::{PreparedPolygon, point_to_polygon, point_to_polygon_limit};
use shared::geometry::{ConvexPolygon, PlaneId};
use tests::cases::{self, Case};

const TAME: f64 = 1e-12;
const HARD: f64 = 1e-15;

fn assert_close(case: &Case, found: f64, expected: f64) {
    let tolerance = if case.group().ends_with("hard") || case.group().ends_with("degenerate") {
        HARD.max(expected * HARD)
    } else {
        expected * TAME
    };
    assert!((found - expected).abs() <= tolerance, "{}: {found:e}, expected {expected:e}", case.id());
}

fn prepared(corners: &[DVec3]) -> PreparedPolygon {
    PreparedPolygon::new(&ConvexPolygon { plane: PlaneId(0), corners: corners.to_vec() })
}

fn point_cases() -> Vec<Case> {
    let plain =
        |case: &Case| case.group().starts_with("point-polygon") && case.geometry("approach").is_null();
    cases::all().into_iter().filter(plain).collect()
}

#[test]
fn point_to_polygon_in_every_case() {
    let cases = point_cases();
    assert!(cases.len() >= 20);
    for case in &cases {
        let normal = case.point("N").normalize();
        let found = point_to_polygon(case.point("P"), normal, &case.polygon("polygon"));
        assert_close(case, found, case.values()[0]);
        let limit = point_to_polygon_limit(
            case.point("P"),
            normal,
            normal.any_orthonormal_vector(),
            &case.polygon("polygon"),
        );
        assert_close(case, limit, case.values()[0]);
    }
}

#[test]
fn prepared_polygons_in_every_convex_case() {
    for case in point_cases() {
        // The concave one is cut in convex parts before it meets a prepared polygon.
        if case.id() == "A11" {
            continue;
        }
        let view = prepared(&case.polygon("polygon")).view(case.point("P"), case.point("N").normalize(), 0.0);
        let (found, expected) = (view.map_or(0.0, |view| view.factor), case.values()[0]);
        let tolerance = (expected * 1e-9).max(1e-15);
        assert!((found - expected).abs() <= tolerance, "{}: {found:e}, expected {expected:e}", case.id());
    }
}

#[test]
fn disks_as_polygons_with_many_corners() {
    for case in cases::all().iter().filter(|case| case.group() == "point-disk") {
        let disk = case.geometry("disk");
        let centre = cases::point(&disk["center"]);
        let corners = 4096;
        // Same area as the disk: the error is of fourth order in the angle of a corner.
        let angle = std::f64::consts::TAU / f64::from(corners);
        let radius = disk["radius"].as_f64().unwrap() * (angle / angle.sin()).sqrt();
        let polygon: Vec<DVec3> = (0..corners)
            .map(|i| {
                let (sine, cosine) = (-angle * f64::from(i)).sin_cos();
                centre + radius * DVec3::new(cosine, sine, 0.0)
            })
            .collect();
        let found = point_to_polygon(case.point("P"), case.point("N"), &polygon);
        assert!((found / case.values()[0] - 1.0).abs() < 1e-6, "{}: {found}", case.id());
    }
}

#[test]
fn faces_around_a_point_close() {
    let case = cases::case("A13");
    let faces = case.geometry("faces").as_object().unwrap();
    let names = ["ceil", "x0", "x1", "y0", "y1"];
    let mut sum = 0.0;
    for (name, expected) in names.iter().zip(case.values()) {
        let found = point_to_polygon(case.point("P"), case.point("N"), &cases::polygon(&faces[*name]));
        assert_close(&case, found, expected);
        sum += found;
    }
    assert!((sum - 1.0_f64).abs() < 1e-15);
}

#[test]
fn limits_at_edges_and_corners() {
    let edge = cases::case("B20");
    let inward = edge.point("approach").normalize();
    let found = point_to_polygon_limit(edge.point("P"), edge.point("N"), inward, &edge.polygon("polygon"));
    assert_close(&edge, found, edge.values()[0]);
    let corner = cases::case("B21");
    let inward = corner.point("approach").normalize();
    for (name, expected) in ["x0", "y0"].iter().zip(corner.values()) {
        let found =
            point_to_polygon_limit(corner.point("P"), corner.point("N"), inward, &corner.polygon(name));
        assert_close(&corner, found, expected);
    }
}

#[test]
fn direct_light_under_a_ceiling() {
    let case = cases::case("D18");
    let points = case.geometry("points").as_array().unwrap();
    for (point, expected) in points.iter().zip(case.values()) {
        let found = point_to_polygon(cases::point(point), DVec3::Z, &case.polygon("ceiling"));
        assert_close(&case, found, expected);
    }
}
