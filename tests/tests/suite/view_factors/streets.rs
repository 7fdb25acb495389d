//! A small city, open to the sky.

use glam::{DQuat, DVec3};
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};
use tests::builder::{Material, SceneBuilder};
use tests::city::city;
use tests::shapes::{self, Polygon};

use super::{by_facets, computed, factor, sums};

/// A number from 0 to 1.
fn uniform(random: &mut TestRng) -> f64 {
    f64::from(random.next_u32()) / 4_294_967_296.0
}

/// Where a ray meets a parallelogram, if it does: the distance.
fn meet(origin: DVec3, direction: DVec3, face: &Polygon) -> Option<f64> {
    let (u, v) = (face[1] - face[0], face[3] - face[0]);
    let normal = u.cross(v);
    let distance = normal.dot(face[0] - origin) / normal.dot(direction);
    let offset = origin + direction * distance - face[0];
    let (x, y) = (offset.dot(u) / u.length_squared(), offset.dot(v) / v.length_squared());
    let inside = (0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y);
    (distance > 1e-9 && inside).then_some(distance)
}

/// The factors of one rectangle to all, by rays that leave it as diffuse radiation does.
fn traced(faces: &[Polygon], from: usize, rays: u32, random: &mut TestRng) -> Vec<f64> {
    let face = &faces[from];
    let (u, v) = (face[1] - face[0], face[3] - face[0]);
    let turn = DQuat::from_rotation_arc(DVec3::Z, u.cross(v).normalize());
    let mut hits = vec![0.0; faces.len()];
    for _ in 0..rays {
        let origin = face[0] + u * uniform(random) + v * uniform(random);
        let (square, angle) = (uniform(random), uniform(random) * std::f64::consts::TAU);
        let (sine, cosine) = angle.sin_cos();
        let local = DVec3::new(cosine * square.sqrt(), sine * square.sqrt(), (1.0 - square).sqrt());
        let direction = turn * local;
        let nearest = faces
            .iter()
            .enumerate()
            .filter(|(index, _)| *index != from)
            .filter_map(|(index, face)| Some((index, meet(origin, direction, face)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        // Backs take and give nothing.
        let front = |index: usize| {
            let face = &faces[index];
            (face[1] - face[0]).cross(face[3] - face[0]).dot(direction) < 0.0
        };
        if let Some((index, _)) = nearest
            && front(index)
        {
            hits[index] += 1.0 / f64::from(rays);
        }
    }
    hits
}

/// Three towers around a square: partly hidden pairs of all kinds.
fn towers() -> Vec<Polygon> {
    let tower = |x: f64, z: f64, height: f64| {
        shapes::box_facing_out(DVec3::new(x, 0.0, z), DVec3::new(x + 2.0, height, z + 2.0))
    };
    let ground = vec![
        DVec3::new(-1.0, 0.0, 9.0),
        DVec3::new(9.0, 0.0, 9.0),
        DVec3::new(9.0, 0.0, -1.0),
        DVec3::new(-1.0, 0.0, -1.0),
    ];
    let mut faces: Vec<Polygon> =
        [tower(0.0, 0.0, 5.0), tower(3.0, 1.5, 3.0), tower(5.5, 5.0, 4.0)].into_iter().flatten().collect();
    faces.push(ground);
    faces
}

#[test]
fn partly_hidden_pairs_agree_with_a_monte_carlo() {
    let faces = towers();
    let factors = computed(&super::scene_of(&faces), view_factors::ViewFactorSettings::default());
    assert!(factors.counts.estimated > 15, "{:?}", factors.counts);
    let rays = 200_000;
    let mut random = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let (mut compared, mut blocked) = (0, 0);
    for from in 0..faces.len() {
        let hits = traced(&faces, from, rays, &mut random);
        for (to, hit) in hits.iter().enumerate() {
            let (found, error) = factor(&factors, from, to);
            let chance = (found.max(*hit) / f64::from(rays)).sqrt();
            // One of 16,000 is farther than four standard errors from the truth; the least is a single ray.
            let limit = 4.0 * error.hypot(chance) + 1.0 / f64::from(rays);
            assert!((found - hit).abs() <= limit, "{from} to {to}: {found} {hit} {limit}");
            compared += u32::from(found > 0.0);
            blocked += u32::from(error > 1e-6 * found);
        }
        let open = 1.0 - hits.iter().sum::<f64>();
        let row = &factors.rows[from];
        let limit = 4.0 * row.standard_error.hypot((0.25 / f64::from(rays)).sqrt()) + 1e-9;
        assert!((row.open - open).abs() <= limit, "{from}: {} {open} {limit}", row.open);
    }
    assert!(compared > 50 && blocked > 30, "{compared} {blocked}");
}

/// Rows of a city and what is open of them sum to 1, and every pair was decided once.
#[test]
fn every_pair_of_a_city_is_decided() {
    let scene = city(600);
    let factors = computed(&scene, by_facets());
    assert!((550..650).contains(&factors.rows.len()), "{}", factors.rows.len());
    for (row, sum) in factors.rows.iter().zip(sums(&factors)) {
        assert!((sum + row.open - 1.0).abs() < 1e-12 && sum < 1.0, "{} {sum}", row.name);
    }
    let counts = factors.counts;
    let count = factors.rows.len() as u64;
    assert_eq!(counts.all, count * (count - 1) / 2);
    assert_eq!(counts.turned_away + counts.hidden + counts.exact + counts.estimated, counts.all);
    assert!(counts.hidden > 0 && counts.exact > 0 && counts.estimated > 0, "{counts:?}");
    assert_eq!(counts.exact + counts.estimated, factors.pairs.len() as u64);
}

/// Every way to write a polygon's triangles: from in front, from behind, mirrored.
#[test]
fn polygons_of_the_file_are_found_again() {
    let hexagon: Polygon = (0..6)
        .map(|i| DQuat::from_rotation_z(f64::from(i) * std::f64::consts::FRAC_PI_3) * DVec3::X)
        .collect();
    let lifted = hexagon.iter().rev().map(|corner| *corner + DVec3::Z).collect::<Polygon>();
    let square: Polygon =
        [[2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 1.0, 0.0], [2.0, 1.0, 0.0]].map(DVec3::from_array).to_vec();
    let scene = SceneBuilder::new()
        .part("floor", &[hexagon, square], Material::grey(0.5).double_sided())
        .part("ceiling", &[lifted], Material::grey(0.5))
        .placed(glam::DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
    let factors = computed(&scene, by_facets());
    let rows: Vec<(&str, f64)> = factors.rows.iter().map(|row| (row.name.as_str(), row.area)).collect();
    let hexagonal = 1.5 * 3.0_f64.sqrt();
    let expected = [
        ("floor/0", hexagonal),
        ("floor/1", 1.0),
        ("floor (back)/0", hexagonal),
        ("floor (back)/1", 1.0),
        ("ceiling/0", hexagonal),
    ];
    assert_eq!(rows.len(), expected.len(), "{rows:?}");
    for ((name, area), (expected_name, expected_area)) in rows.iter().zip(expected) {
        assert_eq!(*name, expected_name);
        assert!((area - expected_area).abs() < 1e-6, "{name}: {area}");
    }
    assert!(factor(&factors, 0, 4).0 > 0.1 && factor(&factors, 2, 4).0 == 0.0);
}
