use std::f64::consts::{PI, TAU};

use glam::DVec3;
use proptest::prelude::*;

use super::angle::{AngleOverSine, Full, Quick};
use super::{LANES, ReceiverLanes, ViewLanes};
use crate::form_factor::{PreparedPolygon, View, contour};
use crate::geometry::{ConvexPolygon, PlaneId};

fn prepared(corners: Vec<DVec3>) -> PreparedPolygon {
    PreparedPolygon::new(&ConvexPolygon { plane: PlaneId(0), corners })
}

fn square(edge: f64) -> PreparedPolygon {
    let half = edge / 2.0;
    prepared(
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| DVec3::new(x, y, 0.0) * half)
            .into(),
    )
}

/// Corners on an ellipse, `flat` times as high as wide, of radius `size`, turned and moved away from the origin.
fn polygon(angles: &[f64], flat: f64, size: f64) -> PreparedPolygon {
    let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -0.4, 0.3);
    let corner =
        |angle: &f64| turn * (DVec3::new(angle.cos(), flat * angle.sin(), 0.0) * size) + DVec3::splat(3.0);
    prepared(angles.iter().map(corner).collect())
}

/// Three to nine angles of a circle, apart from each other, that go around it.
fn angles() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(0.2..1.0, 3..10).prop_map(|steps| {
        let whole: f64 = steps.iter().sum();
        steps
            .iter()
            .scan(0.0, |angle, step| {
                *angle += step / whole * TAU;
                Some(*angle)
            })
            .collect()
    })
}

fn direction() -> impl Strategy<Value = DVec3> {
    (-1.0..1.0, 0.0..TAU).prop_map(|(z, angle): (f64, f64)| {
        let across = (1.0 - z * z).sqrt();
        DVec3::new(across * angle.cos(), across * angle.sin(), z)
    })
}

/// Ways from the polygon, in its radii: near, far and very far; normals, some of them towards it, some across.
fn receivers() -> impl Strategy<Value = Vec<(DVec3, DVec3)>> {
    let receiver = (direction(), -1.5..5.0, direction(), 0..3).prop_map(|(way, distance, normal, kind)| {
        let normal = match kind {
            0 => normal,
            1 => (normal * 0.5 - way).normalize(),
            _ => (way.cross(normal) - way * 0.02).normalize(),
        };
        (way * 10f64.powf(distance), normal)
    });
    prop::collection::vec(receiver, LANES)
}

/// Places next to corners, edges and the lines through them, down to what is rounding in the size of a polygon. Each is an edge by its
/// number, a place along it, a way from there and how far it goes in powers of ten, and a normal, or one across the edge.
type NextToEdges = Vec<(usize, f64, DVec3, f64, DVec3, bool)>;

fn next_to_edges() -> impl Strategy<Value = NextToEdges> {
    let along = prop_oneof![Just(0.0), Just(1.0), -0.5..1.5];
    prop::collection::vec((0_usize..9, along, direction(), -17.0..-2.0, direction(), any::<bool>()), LANES)
}

#[derive(Debug, Default)]
struct Counts {
    whole: usize,
    unanswered: usize,
    cut: usize,
    cut_unanswered: usize,
}

/// The contour sum with arc tangents and what rounding may take of it; the scalar code's series, within 1e-9, where that is much.
/// (Nearly edge-on to a near needle the series loses up to 1e-6.)
fn reference(view: &View, normal: DVec3) -> (f64, f64) {
    let next = view.corners.iter().cycle().skip(1);
    let angles: f64 =
        view.corners.iter().zip(next).map(|(a, b)| a.distance(*b) / a.length().min(b.length())).sum();
    let factor = contour(normal, &view.corners);
    if 1e-15 * angles < 1e-3 * factor { (factor, 1e-15 * angles) } else { (view.factor, 1e-9 * view.factor) }
}

/// Holds every lane to the scalar code.
fn check(polygon: &PreparedPolygon, receivers: &[(DVec3, DVec3)], tolerance: f64) -> Counts {
    let lanes = ReceiverLanes::new(receivers.iter().copied());
    let blockwise = polygon.view_lanes(&lanes, tolerance);
    let mut views = [blockwise.clone()];
    polygon.view_row(&[lanes], tolerance, &mut views);
    let [view] = views;
    assert_eq!((view.cut, blockwise.cut & !blockwise.unanswered), (blockwise.cut, 0));
    assert_eq!(view.unanswered | view.cut, blockwise.unanswered | blockwise.cut);
    let mut counts = Counts::default();
    for (lane, (position, normal)) in receivers.iter().enumerate() {
        let (factor, error) = (view.factors[lane], view.errors[lane]);
        let unanswered = view.unanswered >> lane & 1 == 1;
        let exact = polygon.view(*position, *normal, 0.0);
        let heights = || polygon.corners().iter().map(|corner| normal.dot(*corner - *position));
        let above = heights().any(|height| height > 0.0);
        let whole = heights().all(|height| height >= 0.0);
        let cut = !whole && exact.is_some();
        counts.cut += usize::from(cut);
        counts.cut_unanswered += usize::from(cut && unanswered);
        counts.whole += usize::from(whole && exact.is_some());
        counts.unanswered += usize::from(whole && unanswered);
        if unanswered {
            assert_eq!((factor, error), (0.0, 0.0));
            assert!(above, "what sees nothing is answered");
            continue;
        }
        let Some((exact, rounding)) = exact.map(|view| reference(&view, *normal)) else {
            assert_eq!((factor, error), (0.0, 0.0), "lane {lane} sees nothing");
            continue;
        };
        let lowest = heights().fold(f64::INFINITY, f64::min);
        let is_cut = view.cut >> lane & 1 == 1;
        assert!(!(whole && is_cut), "the horizon does not cut lane {lane}");
        let size = polygon.corners().iter().map(|corner| corner.distance(*position)).fold(0.0, f64::max);
        assert!(is_cut || lowest >= -1e-11 * size, "the horizon cuts lane {lane}");
        // Where the horizon cuts is rounded in the reference too.
        let rounding = rounding + if whole { 0.0 } else { 1e-14 };
        let allowed = tolerance.max(1e-9) * exact + rounding;
        assert!((factor - exact).abs() <= allowed, "lane {lane}: {factor} for {exact}");
        assert!(error >= 0.0 && error <= tolerance * factor, "mean error {error} of {factor}");
    }
    counts
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn lanes_agree_with_the_scalar_code(
        angles in angles(), flat in -3.0..0.0, size in -3.0..3.0, receivers in receivers(), tolerance in -9.0..-3.0,
    ) {
        let size = 10f64.powf(size);
        let polygon = polygon(&angles, 10f64.powf(flat), size);
        let placed: Vec<_> = receivers.iter().map(|(way, normal)| (DVec3::splat(3.0) + *way * size, *normal)).collect();
        check(&polygon, &placed, 10f64.powf(tolerance));
        check(&polygon, &placed, 1e-5);
    }

    /// Corners are not quite in one plane: a point on an edge may be before the polygon, and sees what is rounding.
    #[test]
    fn on_an_edge_of_a_bent_polygon_no_more_than_all_is_seen(
        angles in angles(),
        flat in 0.001..1.0,
        bent in -9.0..-4.0,
        places in next_to_edges(),
        tolerance in prop_oneof![Just(0.0), Just(1e-5), Just(1e-3)],
    ) {
        const SIZE: f64 = 300.0;
        let plane = polygon(&angles, flat, SIZE);
        let mut corners = plane.corners().to_vec();
        corners[0] += plane.normal() * SIZE * 10f64.powf(bent);
        let receivers = places.into_iter().map(|(edge, along, way, distance, normal, is_across)| {
            let [start, end] = [edge, edge + 1].map(|corner| corners[corner % corners.len()]);
            let normal = if is_across { normal.cross(end - start).normalize() } else { normal };
            (start.lerp(end, along) + way * SIZE * 10f64.powf(distance), normal)
        });
        let mut views = [ViewLanes::default()];
        let receivers: Vec<_> = receivers.collect();
        let polygon = prepared(corners.clone());
        polygon.view_row(&[ReceiverLanes::new(receivers.iter().copied())], tolerance, &mut views);
        let [view] = views;
        for (position, normal) in receivers {
            let factor = polygon.view(position, normal, tolerance).map_or(0.0, |view| view.factor);
            prop_assert!((0.0..=1.0).contains(&factor), "{}", factor);
        }
        prop_assert!(view.factors.iter().chain(&view.errors).all(|seen| (0.0..=1.0).contains(seen)), "{:?}", view);
    }

    #[test]
    fn the_width_of_the_vectors_changes_no_bit(
        angles in angles(), receivers in receivers(), tolerance in -9.0..-3.0,
    ) {
        let polygon = polygon(&angles, 0.5, 1.0);
        let lanes = ReceiverLanes::new(receivers.iter().map(|(way, normal)| (DVec3::splat(3.0) + *way, *normal)));
        let tolerance = 10f64.powf(tolerance);
        let plain = bits(&polygon.view_lanes(&lanes, tolerance));
        let widest = crate::simd::widest(#[inline(always)] || polygon.view_lanes(&lanes, tolerance));
        prop_assert_eq!(&plain, &bits(&widest));
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = pulp::x86::V3::try_new() {
            let narrower = avx2.vectorize(At { polygon: &polygon, lanes: &lanes, tolerance });
            prop_assert_eq!(&plain, &bits(&narrower));
        }
        let row = |widest: bool| {
            let blocks = [lanes.clone(), lanes.clone()];
            let mut views = blocks.clone().map(|block| polygon.view_lanes(&block, tolerance));
            if widest {
                crate::simd::widest(
                    #[inline(always)]
                    || polygon.view_row(&blocks, tolerance, &mut views),
                );
            } else {
                polygon.view_row(&blocks, tolerance, &mut views);
            }
            views.each_ref().map(bits)
        };
        prop_assert_eq!(row(false), row(true));
        prop_assert_eq!(&row(false)[0], &row(false)[1]);
        // Nor do the neighbours.
        for (lane, receiver) in receivers.iter().enumerate() {
            let alone = (DVec3::splat(3.0) + receiver.0, receiver.1);
            let alone = polygon.view_lanes(&ReceiverLanes::new([alone]), tolerance);
            prop_assert_eq!(plain.0[lane], alone.factors[0].to_bits());
            prop_assert_eq!(plain.2 >> lane & 1, alone.unanswered);
        }
    }
}

fn bits(view: &ViewLanes) -> ([u64; LANES], [u64; LANES], u32, u32) {
    (view.factors.map(f64::to_bits), view.errors.map(f64::to_bits), view.unanswered, view.cut)
}

#[cfg(target_arch = "x86_64")]
struct At<'a> {
    polygon: &'a PreparedPolygon,
    lanes: &'a ReceiverLanes,
    tolerance: f64,
}

#[cfg(target_arch = "x86_64")]
impl pulp::NullaryFnOnce for At<'_> {
    type Output = ViewLanes;

    #[inline(always)]
    fn call(self) -> ViewLanes {
        self.polygon.view_lanes(self.lanes, self.tolerance)
    }
}

/// A point above the middle of a disc-like polygon has a factor that is known.
#[test]
fn a_square_over_a_point_has_the_factor_of_the_books() {
    for (edge, height) in [(1.0, 0.5), (2.0, 0.01), (0.1, 1.0), (0.01, 1.0)] {
        let lanes = ReceiverLanes::new([(DVec3::new(0.0, 0.0, height), -DVec3::Z)]);
        let view = square(edge).view_lanes(&lanes, 1e-8);
        // Four corner squares of side edge / 2: F = 2/pi x / sqrt(1 + x^2) atan(x / sqrt(1 + x^2)) each, x = side / height.
        let x: f64 = edge / 2.0 / height;
        let slope = x / (1.0 + x * x).sqrt();
        let exact = 4.0 * (slope * slope.atan()) / PI;
        assert!((view.factors[0] / exact - 1.0).abs() < 1e-8, "{} for {exact}", view.factors[0]);
        assert_eq!(view.unanswered, 0);
        assert_eq!(&view.factors[1..], &[0.0; LANES - 1], "lanes left over see nothing");
    }
}

#[test]
fn behind_and_edge_on_there_is_nothing_and_the_horizon_is_left_to_the_scalar_code() {
    let view = square(1.0).view_lanes(
        &ReceiverLanes::new([
            (DVec3::new(0.0, 0.0, -1.0), DVec3::Z),
            (DVec3::new(2.0, 0.0, 0.0), -DVec3::X),
            (DVec3::new(0.0, 0.0, 1.0), DVec3::Z),
            (DVec3::new(0.0, 0.0, 1.0), DVec3::X),
            (DVec3::new(0.5, 0.5, 0.0), DVec3::Z),
            (DVec3::ZERO, -DVec3::Z),
        ]),
        1e-5,
    );
    assert_eq!(view.factors, [0.0; LANES]);
    assert_eq!((view.unanswered, view.cut), (0b1000, 0b1000), "only the fourth sees half of the square");
}

#[test]
fn degenerate_polygons_have_factors_of_zero() {
    let (a, b) = (DVec3::ZERO, DVec3::X);
    for corners in
        [vec![a, a, a], vec![a, b, a, b], vec![a, b, b * 2.0], vec![a, b, b * 2.0, b * 3.0, b * 4.0]]
    {
        let receivers = [(DVec3::new(0.5, 0.0, 1.0), -DVec3::Z), (a, DVec3::Z), (b, DVec3::X)];
        for tolerance in [0.0, 1e-5, 1.0] {
            let view = prepared(corners.clone()).view_lanes(&ReceiverLanes::new(receivers), tolerance);
            assert_eq!((view.factors, view.errors), ([0.0; LANES], [0.0; LANES]), "{corners:?}");
        }
    }
}

#[test]
fn nothing_is_ever_not_a_number() {
    let polygon = square(1.0);
    let places = [-1e300, -1.0, -0.5, -1e-12, 0.0, 1e-300, 1e-12, 0.25, 0.5, 1e8, 1e200];
    let mut receivers = Vec::new();
    for x in places {
        for y in places {
            for z in places {
                receivers.push((DVec3::new(x, y, z), -DVec3::Z));
                receivers.push((DVec3::new(x, y, z), DVec3::new(0.6, 0.0, -0.8)));
            }
        }
    }
    for tolerance in [0.0, 1e-5, 1.0] {
        for block in receivers.chunks(LANES) {
            let view = polygon.view_lanes(&ReceiverLanes::new(block.iter().copied()), tolerance);
            assert!(
                view.factors.iter().chain(&view.errors).all(|number| (0.0..=1.0).contains(number)),
                "{view:?}"
            );
        }
    }
}

#[test]
fn nearly_all_is_answered() {
    let polygon = square(0.2);
    let mut counts = Counts::default();
    let steps = |i: usize, of: f64| (i as f64 * of).fract();
    for block in 0..500 {
        let receiver = |i: usize| {
            let position = DVec3::new(steps(i, 0.754_877), steps(i, 0.569_840), steps(i, 0.618_034))
                - DVec3::new(0.5, 0.5, 0.0);
            let towards = DVec3::new(steps(i, 0.414_214), steps(i, 0.732_051), steps(i, 0.236_068)) - 0.5;
            (position, towards.normalize())
        };
        let receivers: Vec<_> = (block * LANES..(block + 1) * LANES).map(receiver).collect();
        let found = check(&polygon, &receivers, 1e-5);
        counts.whole += found.whole;
        counts.unanswered += found.unanswered;
        counts.cut += found.cut;
        counts.cut_unanswered += found.cut_unanswered;
    }
    assert!(counts.whole > 2000 && counts.unanswered * 1000 <= counts.whole, "{counts:?}");
    assert!(counts.cut > 1000 && counts.cut_unanswered * 50 <= counts.cut, "{counts:?}");
}

#[test]
fn the_polynomials_are_as_exact_as_stated() {
    fn worst<A: AngleOverSine>() -> f64 {
        (1..=20_000).map(|i| f64::from(i) / 10_000.0).fold(0.0, |worst, w| {
            let angle = 2.0 * libm::asin(w.sqrt() / 2.0);
            let sine = (w * (1.0 - w / 4.0)).sqrt();
            let error = 1.0 + w * A::beyond_one(w) - angle / sine;
            worst.max(error.abs() / w.max(0.5))
        })
    }
    assert!(worst::<Quick>() < Quick::ERROR, "{}", worst::<Quick>());
    // The reference itself is rounded.
    assert!(worst::<Full>() < 2e-15, "{}", worst::<Full>());
}
