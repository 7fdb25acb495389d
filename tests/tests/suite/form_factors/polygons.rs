//! A polygon to a polygon.

use kernel::form_factor::polygon_to_polygon;
use kernel::geometry::ConvexPolygon;
use tests::cases::{Case, case};
use tests::shapes;

use super::Within::{self, Relative};
use super::{convex, polygon_for_disk, radius_of_equal_area};

/// Rounding of some hundred terms, whether the polygons are near, far or share an edge: 1e-12 is asked for.
const TAME: Within = Relative(1e-14);

/// Rounding is in proportion to the product of the perimeters, 4 here. The exchange area is a few thousandths of it, or less.
const NARROW: Within = Relative(1e-13);

const PAIRS: [(&str, Within); 13] = [
    ("C01", TAME),
    ("C02", TAME),
    ("C03", TAME),
    ("C04", TAME),
    ("C05", TAME),
    ("C06", TAME),
    ("C08", NARROW),
    ("C09", NARROW),
    ("C10", TAME),
    ("C12", TAME),
    ("C14", TAME),
    ("C15", TAME),
    ("D22", NARROW),
];

fn pair(case: &Case) -> [ConvexPolygon; 2] {
    [convex(0, &case.polygon("polygon1")), convex(1, &case.polygon("polygon2"))]
}

#[test]
fn factors_both_ways() {
    for (id, tolerance) in PAIRS {
        let case = case(id);
        let [from, to] = pair(&case);
        let expected = case.values()[0];
        tolerance.check(id, polygon_to_polygon(&from, &to), expected);
        tolerance.check(id, polygon_to_polygon(&to, &from), expected * from.area() / to.area());
    }
}

/// C08 and D22 are the two ways of one pair of polygons, whose areas differ by a factor of 1024.
#[test]
fn reciprocity() {
    let factors = ["C08", "D22"].map(|id| {
        let [from, to] = pair(&case(id));
        polygon_to_polygon(&from, &to)
    });
    NARROW.check("C08 from D22", factors[0], factors[1] / 1024.0);
}

/// Opposite and adjacent faces of the cube, each pair of which is met; together they fill the hemisphere.
#[test]
fn faces_of_the_cube() {
    let [opposite, adjacent] = case("D00").values()[..] else { panic!("two values") };
    let faces: Vec<ConvexPolygon> =
        shapes::unit_room().iter().zip(0..).map(|(face, plane)| convex(plane, face)).collect();
    for (i, face) in faces.iter().enumerate() {
        let mut sum = 0.0;
        for (j, other) in faces.iter().enumerate() {
            let expected = match j {
                _ if i == j => 0.0,
                _ if i / 2 == j / 2 => opposite,
                _ => adjacent,
            };
            let found = polygon_to_polygon(face, other);
            TAME.check("D00", found, expected);
            sum += found;
        }
        TAME.check("sum of D00", sum, 1.0);
    }
}

/// Coaxial disks as regular polygons of the same area, corner over corner. The error is of the fourth order in the angle between
/// corners: with 128 of them it is 16 times that with 256, which takes it out and leaves the sixth order.
#[test]
fn disks() {
    for id in ["C20", "C22"] {
        let case = case(id);
        let [coarse, fine] =
            [128, 256].map(|corners| disk_to_disk(&case, corners, radius_of_equal_area(corners)));
        Relative(2e-9).check(id, fine, case.values()[0]);
        Relative(1e-12).check(id, fine + (fine - coarse) / 15.0, case.values()[0]);
    }
}

/// Disks whose gap is a thousandth of the radius. What is lost goes out through the gap, as the perimeter over the area, which is
/// the disk's for polygons around it. What is left comes from the corners, where the gap meets itself: it is of the first order in
/// the angle between them.
#[test]
fn nearly_touching_disks() {
    let case = case("C23");
    let expected = case.values()[0];
    let radius = |corners: u32| 1.0 / (std::f64::consts::PI / f64::from(corners)).cos();
    let [coarse, fine] = [64, 256].map(|corners| disk_to_disk(&case, corners, radius(corners)));
    Relative(1e-8).check(case.id(), fine, expected);
    assert!((coarse - expected).abs() > 4.0 * (fine - expected).abs());
}

fn disk_to_disk(case: &Case, corners: u32, radius: f64) -> f64 {
    let [from, to] = ["disk1", "disk2"].map(|name| polygon_for_disk(case.geometry(name), corners, radius));
    polygon_to_polygon(&convex(0, &from), &convex(1, &to))
}
