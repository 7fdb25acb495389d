//! Random polygons and random scenes against what is true of all.

use bake::BakeSettings;
use glam::{DMat4, DQuat, DVec3};
use kernel::form_factor::{PreparedPolygon, point_to_polygon};
use kernel::geometry::{ConvexPolygon, PlaneId, area_vector};
use kernel::replica::Receiver;
use kernel::row::{Precision, Shape, Shooter};
use kernel::visibility::ReceiverGroups;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use tests::builder::{Material, SceneBuilder};
use tests::shapes::{Polygon, box_facing_in, box_facing_out};
use worker::engine::{Scene, compute_row};

use super::checked::{CLOSED, Expectation, OPEN, checked, coarse};

const PRECISION: Precision = Precision {
    rays_per_hemisphere: 256,
    minimum_rays: 4,
    maximum_rays: 64,
    seed: 3,
    form_factor_error: 0.0,
    factor_rounding: 0.0,
    ..Precision::DEFAULT
};

/// The same cases at each run: a sum is now and then over its bound by a hair, and says nothing of what was changed.
const SEED: RngSeed = RngSeed::Fixed(1);

fn vector(range: std::ops::Range<f64>) -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(range).prop_map(DVec3::from_array)
}

fn direction() -> impl Strategy<Value = DVec3> {
    vector(-1.0..1.0).prop_filter_map("has no direction", |v| (v.length() > 0.1).then(|| v.normalize()))
}

/// A convex polygon of three to eight corners, from a fair one to a needle of a thousandth its length.
fn polygon(size: f64) -> impl Strategy<Value = Polygon> {
    (vector(-2.0..2.0), direction(), direction(), 3_u32..9, -10.0..0.0_f64).prop_filter_map(
        "has no area",
        move |(centre, u, w, corners, thin)| {
            let v = u.cross(w).try_normalize()?;
            let at = |i: u32| {
                let (sine, cosine) = (std::f64::consts::TAU * f64::from(i) / f64::from(corners)).sin_cos();
                centre + (u * cosine + v * (sine * thin.exp2())) * size
            };
            Some((0..corners).map(at).collect())
        },
    )
}

fn convex(corners: &[DVec3], plane: u32) -> ConvexPolygon {
    ConvexPolygon { plane: PlaneId(plane), corners: corners.to_vec() }
}

fn scaled(corners: &[DVec3], factor: f64) -> Polygon {
    corners.iter().map(|corner| *corner * factor).collect()
}

fn receiver(position: DVec3, normal: DVec3) -> Receiver {
    Receiver { position, normal, plane: PlaneId::NONE }
}

/// The visible factor of a polygon behind these blockers.
fn visible(at: Receiver, polygon: &[DVec3], blockers: &[Polygon]) -> f32 {
    let blockers: Vec<ConvexPolygon> =
        blockers.iter().zip(1..).map(|(corners, id)| convex(corners, id)).collect();
    let shooter = Shooter { key: 5, shape: Shape::Polygons(vec![convex(polygon, 0)]) };
    compute_row(&Scene::new(&blockers), &ReceiverGroups::new(vec![at]), 0, &shooter, &PRECISION).0[0]
}

/// Mean factor from points of one polygon, in the middles of pieces of its fan, to another.
fn mean_factor(from: &[DVec3], to: &[DVec3]) -> f64 {
    const CELLS: u32 = 12;
    let normal = area_vector(from).normalize();
    let (mut sum, mut area) = (0.0, 0.0);
    for pair in from[1..].windows(2) {
        let (u, v) = (pair[0] - from[0], pair[1] - from[0]);
        let own = u.cross(v).length();
        let step = 1.0 / f64::from(CELLS);
        for i in 0..CELLS {
            for j in 0..CELLS - i {
                let at = |part: f64| {
                    from[0] + u * ((f64::from(i) + part) * step) + v * ((f64::from(j) + part) * step)
                };
                let thirds: &[f64] = if i + j + 1 < CELLS { &[1.0 / 3.0, 2.0 / 3.0] } else { &[1.0 / 3.0] };
                for part in thirds {
                    sum += own * point_to_polygon(at(*part), normal, to);
                    area += own;
                }
            }
        }
    }
    sum / area
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, rng_seed: SEED, failure_persistence: None, ..ProptestConfig::default() })]

    /// From 0 to 1, the same by both forms, and the same bits in a scene any power of two as large.
    #[test]
    fn factors_of_polygons(corners in polygon(0.7), at in vector(-2.0..2.0), normal in direction(), exponent in -40_i32..40) {
        let factor = point_to_polygon(at, normal, &corners);
        prop_assert!((0.0..=1.0 + 1e-15).contains(&factor), "{factor}");
        let prepared = |factor: f64| {
            let view = PreparedPolygon::new(&convex(&scaled(&corners, factor), 0)).view(at * factor, normal, 1e-5);
            view.map_or(0.0, |view| view.factor)
        };
        // The promise of the centred form; what is nearly edge-on may count as edge-on.
        prop_assert!((prepared(1.0) - factor).abs() <= 1e-8 * factor + 1e-12, "{} and {factor}", prepared(1.0));
        let size = f64::from(exponent).exp2();
        prop_assert_eq!(point_to_polygon(at * size, normal, &scaled(&corners, size)), factor);
        prop_assert_eq!(prepared(size), prepared(1.0));
    }

    /// Blockers only take away; where they are a power of two as large with all the rest, they take the same bits.
    #[test]
    fn visible_factors_of_polygons(
        corners in polygon(0.7), blockers in prop::collection::vec(polygon(0.5), 0..12),
        at in vector(-2.0..2.0), normal in direction(), exponent in -8_i32..8,
    ) {
        let at = receiver(at, normal);
        let whole = point_to_polygon(at.position, normal, &corners);
        let found = visible(at, &corners, &blockers);
        prop_assert!(found >= 0.0 && f64::from(found) <= whole * (1.0 + 1e-7) + 1e-12, "{found:e} of {whole:e}");
        let size = f64::from(exponent).exp2();
        let larger: Vec<Polygon> = blockers.iter().map(|blocker| scaled(blocker, size)).collect();
        let there = Receiver { position: at.position * size, ..at };
        prop_assert_eq!(visible(there, &scaled(&corners, size), &larger), found);
    }

    /// The faces of a box fill the hemisphere of every point in it, whatever its normal.
    #[test]
    fn closed_boxes(low in vector(-3.0..-0.01), high in vector(0.01..3.0), part in vector(0.001..0.999), normal in direction()) {
        let at = low + (high - low) * part;
        let sum: f64 = box_facing_in(low, high).iter().map(|face| point_to_polygon(at, normal, face)).sum();
        prop_assert!((sum - 1.0).abs() <= 1e-13, "{sum}");
    }

    /// A1 F12 = A2 F21. Means over points agree to a hundredth where the polygons are as far apart as they are wide.
    #[test]
    fn reciprocity(one in polygon(0.4), other in polygon(0.4), shift in direction()) {
        let other: Polygon = other.iter().map(|corner| *corner * 0.3 + shift * 1.5).collect();
        let one: Polygon = one.iter().map(|corner| *corner * 0.3).collect();
        let there = area_vector(&one).length() * mean_factor(&one, &other);
        let back = area_vector(&other).length() * mean_factor(&other, &one);
        // What one horizon cuts off of the other polygon makes kinks.
        let scale = area_vector(&one).length() * area_vector(&other).length();
        prop_assert!((there - back).abs() <= 0.01 * there.max(back) + 1e-3 * scale, "{there:e} there, {back:e} back");
    }
}

/// Boxes of random size, turn and colour, each in a cell of its own, some of them lamps; the first always is.
fn boxes() -> impl Strategy<Value = SceneBuilder> {
    let solid = (
        vector(0.02..0.2),
        direction(),
        0.0..3.0_f64,
        vector(0.0..0.95),
        prop::option::weighted(0.3, vector(0.0..9.0)),
    );
    (vector(0.0..0.999), prop::collection::vec(solid, 1..6)).prop_map(|(walls, solids)| {
        let walls = Material { reflectance: walls, ..Material::grey(0.0) };
        let room =
            SceneBuilder::new().part("room", &box_facing_in(DVec3::ZERO, DVec3::new(2.1, 1.4, 0.7)), walls);
        solids.into_iter().enumerate().fold(
            room,
            |builder, (index, (half, axis, angle, reflectance, lamp))| {
                let exitance = lamp.unwrap_or(if index == 0 { DVec3::ONE } else { DVec3::ZERO });
                let material = Material { reflectance, exitance, double_sided: false };
                let centre = DVec3::new(0.7 * (index % 3) as f64, 0.7 * (index / 3) as f64, 0.0) + 0.35;
                let placed = DMat4::from_rotation_translation(DQuat::from_axis_angle(axis, angle), centre);
                // The corner of the largest box is as far from its middle as the walls of the cell.
                builder.part(&format!("box {index}"), &box_facing_out(-half, half), material).placed(placed)
            },
        )
    })
}

/// Triangles anywhere, through one another, lit on one side or on both, under a point light.
fn soup() -> impl Strategy<Value = SceneBuilder> {
    let triangle = prop::array::uniform3(vector(-1.0..1.0));
    let part = (prop::collection::vec(triangle, 1..5), 0.0..0.99_f64, 0.0..3.0_f64, any::<bool>());
    (prop::collection::vec(part, 1..4), vector(-1.0..1.0)).prop_map(|(parts, light)| {
        let lit = SceneBuilder::new().point_light(light, 1.0);
        parts.into_iter().enumerate().fold(
            lit,
            |builder, (index, (triangles, reflectance, exitance, double_sided))| {
                let polygons: Vec<Polygon> = triangles.iter().map(|corners| corners.to_vec()).collect();
                let material = Material { double_sided, ..Material::grey(reflectance).emitting(exitance) };
                builder.part(&format!("part {index}"), &polygons, material)
            },
        )
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, rng_seed: SEED, failure_persistence: None, ..ProptestConfig::default() })]

    /// Rows close at every vertex, whatever stands in the room.
    #[test]
    fn rooms_of_boxes(builder in boxes()) {
        checked(&builder, &quick(), Expectation { imbalance: 0.2, warns: None, ..CLOSED });
    }

    #[test]
    fn triangle_soup(builder in soup()) {
        checked(&builder, &quick(), Expectation { imbalance: 1.0, warns: None, ..OPEN });
    }
}

/// As little as makes a bake.
fn quick() -> BakeSettings {
    BakeSettings { max_vertices: Some(1500), validation_samples: 256, ..coarse() }
}
