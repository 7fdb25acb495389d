//! Visible form factors, as a worker computes them, against the occluded cases of `form_factors.json`.

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::replica::Receiver;
use kernel::row::{Precision, Shape, Shooter};
use kernel::visibility::ReceiverGroups;
use tests::cases::case;
use worker::engine::{Scene, compute_row};

const RECEIVING: PlaneId = PlaneId(0);
const SHOOTING: PlaneId = PlaneId(1);
const BLOCKING: PlaneId = PlaneId(2);

const PRECISION: Precision = Precision {
    rays_per_hemisphere: 4096,
    minimum_rays: 256,
    maximum_rays: 256,
    seed: 0,
    factor_rounding: 0.0,
    ..Precision::DEFAULT
};

/// The blocker as `cells` x `cells` parallelograms.
fn divided(blocker: &[DVec3], cells: u32) -> Vec<ConvexPolygon> {
    let (origin, u, v) = (blocker[0], blocker[1] - blocker[0], blocker[3] - blocker[0]);
    let at = |i: u32, j: u32| {
        origin + u * (f64::from(i) / f64::from(cells)) + v * (f64::from(j) / f64::from(cells))
    };
    let quads = (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j)));
    quads
        .map(|(i, j)| ConvexPolygon {
            plane: BLOCKING,
            corners: vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)],
        })
        .collect()
}

/// Mean visible factor of these receivers to a polygon, and the pairs that were sampled with rays.
fn mean_factor(receivers: &[Receiver], polygon: &[DVec3], blockers: &[ConvexPolygon]) -> (f64, u64) {
    let polygon = ConvexPolygon { plane: SHOOTING, corners: polygon.to_vec() };
    let shooter = Shooter { key: 7, shape: Shape::Polygons(vec![polygon]) };
    let (row, statistics) = compute_row(
        &Scene::new(blockers),
        &ReceiverGroups::new(receivers.to_vec()),
        100,
        &shooter,
        &PRECISION,
    );
    (row.iter().map(|factor| f64::from(*factor)).sum::<f64>() / row.len() as f64, statistics.sampled_pairs)
}

/// Midpoints of a square's `cells` x `cells` cells.
pub fn receivers_on(square: &[DVec3], cells: u32) -> Vec<Receiver> {
    let (u, v) = (square[1] - square[0], square[3] - square[0]);
    let place = move |i: u32| (f64::from(i) + 0.5) / f64::from(cells);
    let middles = (0..cells).flat_map(move |i| (0..cells).map(move |j| u * place(i) + v * place(j)));
    middles
        .map(|offset| Receiver {
            position: square[0] + offset,
            normal: u.cross(v).normalize(),
            plane: RECEIVING,
        })
        .collect()
}

/// The error of the midpoint rule goes with the square of the cells' size; without it there is little but the rounding of rows,
/// which are stored in f32.
#[test]
fn blocker_between_two_squares_computed() {
    let case = case("C30");
    let blocker = divided(&case.polygon("blocker"), 1);
    let [coarse, fine] = [64, 128].map(|cells| {
        let receivers = receivers_on(&case.polygon("polygon1"), cells);
        let (factor, sampled) = mean_factor(&receivers, &case.polygon("polygon2"), &blocker);
        assert_eq!(sampled, 0);
        factor
    });
    let found = fine + (fine - coarse) / 3.0;
    let error = found / case.values()[0] - 1.0;
    assert!(error.abs() <= f64::from(f32::EPSILON), "{found}, off by {error:e}");
}

/// In many pieces the same blocker is sampled by rays. Counting hits alone would be 12 % off.
#[test]
fn blocker_between_two_squares_sampled() {
    let case = case("C30");
    let receivers = receivers_on(&case.polygon("polygon1"), 32);
    let blocker = divided(&case.polygon("blocker"), 12);
    let (found, sampled) = mean_factor(&receivers, &case.polygon("polygon2"), &blocker);
    assert!(sampled > 500, "{sampled} of {} pairs sampled", receivers.len());
    let error = found / case.values()[0] - 1.0;
    assert!(error.abs() <= 1e-3, "{found}, off by {error:e}");
}

#[test]
fn half_of_an_emitter_behind_an_edge() {
    let case = case("C32");
    let receiver = Receiver { position: case.point("P"), normal: case.point("N"), plane: RECEIVING };
    for cells in [1, 4] {
        let blocker = divided(&case.polygon("blocker"), cells);
        let (found, sampled) = mean_factor(&[receiver], &case.polygon("polygon"), &blocker);
        assert_eq!(sampled, 0);
        // Rows are stored in f32.
        let error = found / case.values()[0] - 1.0;
        assert!(error.abs() <= f64::from(f32::EPSILON), "{cells} x {cells}: {found}, off by {error:e}");
    }
}

/// A share of the wall behind a box, seen from the floor beside the box: all of it is hidden. Corners of the share's pieces fall
/// together here, and an edge without length must not decide what is apart.
#[test]
fn wall_behind_a_box() {
    let low = [[6.632, -312.237], [127.418, 92.525], [532.181, -28.261], [411.394, -433.024]];
    let corner = |i: usize, height: f64| DVec3::new(low[i % 4][0], height, low[i % 4][1]);
    let side = |i: usize| vec![corner(i, 0.0), corner(i + 1, 0.0), corner(i + 1, 422.4), corner(i, 422.4)];
    let top = (0..4).map(|i| corner(i, 422.4)).collect();
    let mut faces: Vec<Vec<DVec3>> = (0..4).map(side).collect();
    faces.push(top);
    let blockers: Vec<ConvexPolygon> = faces
        .into_iter()
        .zip(BLOCKING.0..)
        .map(|(corners, plane)| ConvexPolygon { plane: PlaneId(plane), corners })
        .collect();
    for height in [0.0, 176.0, 440.0] {
        let share = [[0.0, 20.15], [176.0, 20.15], [176.0, -155.85], [0.0, -155.85]]
            .map(|[y, z]| DVec3::new(723.806, height + y, z));
        let receiver = Receiver { position: DVec3::ZERO, normal: DVec3::Y, plane: RECEIVING };
        assert!(mean_factor(&[receiver], &share, &[]).0 > 0.0);
        assert_eq!(mean_factor(&[receiver], &share, &blockers), (0.0, 0), "share from {height} up");
    }
}
