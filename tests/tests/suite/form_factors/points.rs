//! A point to a polygon.

use glam::DVec3;
use kernel::form_factor::{PreparedPolygon, point_to_polygon, point_to_polygon_limit};
use kernel::row::Precision;
use tests::cases::{self, Case, case};

use super::Within::{self, Absolute, Relative};
use super::{convex, polygon_for_disk, radius_of_equal_area};

/// Tame cases, in which no digits are lost: 1e-12 is asked for, but the four to sixteen terms of a contour sum are rounded to
/// 1e-16 of the result.
const TAME: Within = Relative(1e-15);

/// Hard cases, in which the terms of the contour sum may cancel: 1e-15 is asked for. Each term is 1/2 at most and rounded to 2^-54,
/// so a few of those is how far off the sum is, however small.
const HARD: Within = Absolute(2e-16);

/// Zero by a decision, not by a sum.
const EXACT: Within = Absolute(0.0);

/// The fast way is the same contour sum where the polygon is near, and has no more error than that.
const FAST: Within = Relative(1e-15);

/// A factor of some 1e-7 as the difference of terms of the order 1 keeps nine digits. For the fast way 1e-5 is asked for.
const FAST_CANCELLING: Within = Relative(1e-9);

/// Case, what the exact factor may be off, and what the fast one may.
const POLYGONS: [(&str, Within, Within); 21] = [
    ("A01", TAME, FAST),
    ("A02", TAME, FAST),
    ("A03", TAME, FAST),
    ("A04", TAME, FAST),
    ("A08", TAME, FAST),
    ("A09", TAME, FAST),
    ("A11", TAME, FAST),
    // Far: the fast way does not cancel, and neither does the exact one where the edges lie symmetrically.
    ("B01", HARD, FAST),
    ("B02", HARD, FAST),
    ("B04", HARD, FAST),
    // A sliver, and a polygon that is seen edge on: long terms against each other.
    ("B05", HARD, FAST_CANCELLING),
    ("B07", HARD, FAST_CANCELLING),
    ("B09", HARD, FAST),
    ("B10", HARD, FAST),
    ("B11", HARD, FAST),
    ("B13", HARD, FAST),
    ("B14", HARD, FAST),
    ("B15", HARD, FAST),
    ("B23", EXACT, EXACT),
    ("B24", EXACT, EXACT),
    ("B25", EXACT, EXACT),
];

/// The factor as rows have it; polygons may be taken for points where that costs no more than `tolerance` of it.
fn fast_within(tolerance: f64, case: &Case, corners: &[DVec3]) -> f64 {
    let prepared = PreparedPolygon::new(&convex(0, corners));
    let view = prepared.view(case.point("P"), case.point("N").normalize(), tolerance);
    view.map_or(0.0, |view| view.factor)
}

/// The factor as rows have it where no polygon may be taken for a point.
fn fast(case: &Case, corners: &[DVec3]) -> f64 {
    fast_within(0.0, case, corners)
}

/// The factor of all convex parts: prepared polygons are convex, and the L is cut in two, as the import does.
fn fast_parts(tolerance: f64, case: &Case) -> f64 {
    let polygon = case.polygon("polygon");
    let parts = match case.id() {
        "A11" => vec![polygon[0..4].to_vec(), [&polygon[..1], &polygon[3..]].concat()],
        _ => vec![polygon],
    };
    parts.iter().map(|part| fast_within(tolerance, case, part)).sum()
}

#[test]
fn exact_factors() {
    for (id, tolerance, _) in POLYGONS {
        let case = case(id);
        let (position, normal) = (case.point("P"), case.point("N").normalize());
        let polygon = case.polygon("polygon");
        let expected = case.values()[0];
        tolerance.check(id, point_to_polygon(position, normal, &polygon), expected);
        // Away from edges and corners the limit is the same, from wherever the point comes.
        let inward = normal.any_orthonormal_vector();
        tolerance.check(id, point_to_polygon_limit(position, normal, inward, &polygon), expected);
    }
}

#[test]
fn fast_factors() {
    for (id, _, tolerance) in POLYGONS {
        let case = case(id);
        let found = fast_parts(0.0, &case);
        tolerance.check(id, found, case.values()[0]);
    }
}

/// A polygon that is taken for a point has no more than the error that was allowed, down to the 1e-5 that bakes allow.
#[test]
fn polygons_taken_for_points() {
    let mut taken = 0;
    for (id, _, _) in POLYGONS {
        let case = case(id);
        let expected = case.values()[0];
        for allowed in [Precision::DEFAULT.form_factor_error, 1e-3, 0.1, 0.5] {
            let found = fast_parts(allowed, &case);
            taken += usize::from(found != fast_parts(0.0, &case));
            Absolute(allowed * expected + 1e-15).check(id, found, expected);
        }
    }
    assert!(taken >= 5, "{taken} polygons were taken for points");
}

/// With 4096 corners and the area of the disk: the error is of the fourth order in the angle between corners, 1e-14 here. The sum
/// of as many terms is rounded to about as much.
#[test]
fn disks() {
    for id in ["A06", "A07"] {
        let case = case(id);
        let polygon = polygon_for_disk(case.geometry("disk"), 4096, radius_of_equal_area(4096));
        let expected = case.values()[0];
        let found = point_to_polygon(case.point("P"), case.point("N"), &polygon);
        Relative(5e-14).check(id, found, expected);
        Relative(5e-14).check(id, fast(&case, &polygon), expected);
    }
}

#[test]
fn faces_around_a_point_close() {
    let case = case("A13");
    let faces = ["ceil", "x0", "x1", "y0", "y1"].map(|name| cases::polygon(&case.geometry("faces")[name]));
    let (mut exact_sum, mut fast_sum) = (0.0, 0.0);
    for (face, expected) in faces.iter().zip(case.values()) {
        let exact = point_to_polygon(case.point("P"), case.point("N"), face);
        TAME.check(case.id(), exact, expected);
        FAST.check(case.id(), fast(&case, face), expected);
        exact_sum += exact;
        fast_sum += fast(&case, face);
    }
    TAME.check("sum", exact_sum, 1.0);
    FAST.check("sum", fast_sum, 1.0);
}

/// On the edge of a wall and in the corner between two; rows are computed a little way inside, where the factor is that of the
/// limit but for about the way over the wall's size.
#[test]
fn limits_at_edges_and_corners() {
    let way = 2.0_f64.powi(-20);
    for (id, walls) in [("B20", &["polygon"][..]), ("B21", &["x0", "y0"])] {
        let case = case(id);
        let (position, normal) = (case.point("P"), case.point("N"));
        let inward = case.point("approach").normalize();
        for (wall, expected) in walls.iter().map(|name| case.polygon(name)).zip(case.values()) {
            HARD.check(id, point_to_polygon_limit(position, normal, inward, &wall), expected);
            let prepared = PreparedPolygon::new(&convex(0, &wall));
            let view = prepared.view(position + inward * way, normal, 0.0);
            Absolute(way).check(id, view.map_or(0.0, |view| view.factor), expected);
        }
    }
}

#[test]
fn direct_light_under_a_ceiling() {
    let case = case("D18");
    let points = case.geometry("points").as_array().unwrap();
    let ceiling = case.polygon("ceiling");
    for (point, expected) in points.iter().map(cases::point).zip(case.values()) {
        TAME.check(case.id(), point_to_polygon(point, DVec3::Z, &ceiling), expected);
        let view = PreparedPolygon::new(&convex(0, &ceiling)).view(point, DVec3::Z, 0.0);
        FAST.check(case.id(), view.map_or(0.0, |view| view.factor), expected);
    }
}
