//! Closed scenes with things in the way.

use glam::{DMat4, DQuat, DVec3};
use tests::builder::{Material, SceneBuilder};
use tests::shapes::{self, Polygon};
use view_factors::{ViewFactorSettings, ViewFactors};

use super::{by_facets, computed, factor, sums};

/// A room of 4 x 3 x 4 with a box on its floor and one that hangs in it, each face divided into squares.
fn furnished(cells: u32) -> SceneBuilder {
    let grey = Material::grey(0.5);
    let divide = |faces: Vec<Polygon>| -> Vec<Polygon> {
        faces.iter().flat_map(|face| divided(face, cells)).collect()
    };
    let room = divide(shapes::box_facing_in(DVec3::ZERO, DVec3::new(4.0, 3.0, 4.0)));
    // Without the face that it stands on.
    let mut standing = shapes::box_facing_out(DVec3::new(1.0, 0.0, 1.0), DVec3::new(2.0, 1.5, 2.5));
    standing.remove(2);
    let hanging = shapes::box_facing_out(DVec3::new(2.5, 1.25, 1.5), DVec3::new(3.0, 2.0, 2.5));
    SceneBuilder::new().part("room", &room, grey).part("standing", &divide(standing), grey).part(
        "hanging",
        &divide(hanging),
        grey,
    )
}

fn divided(face: &Polygon, cells: u32) -> Vec<Polygon> {
    let (u, v) = ((face[1] - face[0]) / f64::from(cells), (face[3] - face[0]) / f64::from(cells));
    let at = |i: u32, j: u32| face[0] + u * f64::from(i) + v * f64::from(j);
    let cells = (0..cells).flat_map(move |i| (0..cells).map(move |j| (i, j)));
    cells.map(|(i, j)| vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]).collect()
}

fn turned_room(cells: u32) -> SceneBuilder {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7);
    furnished(cells).all_placed(DMat4::from_rotation_translation(turn, DVec3::new(3.0, -2.0, 5.0)))
}

/// The floor under the box sees nothing, and is no part of what is tested.
fn seen(factors: &ViewFactors) -> Vec<usize> {
    let sums = sums(factors);
    (0..sums.len()).filter(|row| sums[*row] > 0.0).collect()
}

#[test]
fn rows_of_a_furnished_room_close_by_a_small_correction() {
    for scene in [furnished(4), turned_room(4)] {
        let factors = computed(&scene, by_facets());
        assert_eq!(factors.rows.len(), (6 + 5 + 6) * 16);
        let sums = sums(&factors);
        let seen = seen(&factors);
        for &row in &seen {
            let whole = sums[row] + factors.rows[row].open;
            assert!((whole - 1.0).abs() < 1e-12, "{}: {whole}", factors.rows[row].name);
        }
        // Floor and box touch in squares that lie partly under the box: what is under it sees nothing, and is open.
        let closed = seen.iter().filter(|row| factors.rows[**row].open == 0.0).count();
        assert_eq!(closed, factors.closed_rows);
        assert!(closed >= seen.len() - 9, "{closed} of {}", seen.len());
        for row in &factors.rows {
            assert!(row.correction.abs() <= 6.0 * row.standard_error + 1e-6, "{row:?}");
        }
        let largest = factors.most_corrected().unwrap().correction.abs();
        assert!(largest > 0.0 && largest < 5e-3, "{largest}");
        assert!(factors.pairs.iter().all(|pair| pair.area >= 0.0));
    }
}

/// What is exact stays exact: parts of the room between which nothing stands.
#[test]
fn closing_leaves_exact_pairs_alone() {
    let factors = computed(&furnished(3), by_facets());
    let room = shapes::box_facing_in(DVec3::ZERO, DVec3::new(4.0, 3.0, 4.0));
    let room: Vec<Polygon> = room.iter().flat_map(|face| divided(face, 3)).collect();
    let bare = computed(&SceneBuilder::new().part("room", &room, Material::grey(0.5)), by_facets());
    let mut exact = 0;
    for pair in factors.pairs.iter().filter(|pair| pair.to < 54 && pair.variance == 0.0) {
        let (expected, _) = factor(&bare, pair.from as usize, pair.to as usize);
        let found = pair.area / factors.rows[pair.from as usize].area;
        assert!((found - expected).abs() < 1e-14, "{pair:?}: {found} {expected}");
        exact += 1;
    }
    assert!(exact > 100 && factors.counts.estimated > 100, "{exact} {:?}", factors.counts);
}

/// Two seeds differ by their standard errors, and not by less than these promise either.
#[test]
fn independent_seeds_agree_within_their_standard_errors() {
    let with = |seed, points| {
        let settings = ViewFactorSettings { seed, points, ..by_facets() };
        computed(&turned_room(3), settings)
    };
    for points in [256, 4096] {
        let [first, second] = [with(1, points), with(2, points)];
        let (mut within, mut all, mut squares) = (0, 0, 0.0);
        for from in 0..first.rows.len() {
            for to in from + 1..first.rows.len() {
                let ((a, of_a), (b, of_b)) = (factor(&first, from, to), factor(&second, from, to));
                let error = of_a.hypot(of_b);
                // By a rule, or exact.
                if error <= 1e-6 * a.max(b) {
                    assert!((a - b).abs() <= 1e-6 * a.max(b), "{from} {to}: {a} {b}");
                    continue;
                }
                let z = (a - b) / error;
                all += 1;
                within += u32::from(z.abs() <= 3.0);
                squares += z.clamp(-5.0, 5.0).powi(2);
            }
        }
        let (share, spread) = (f64::from(within) / f64::from(all), (squares / f64::from(all)).sqrt());
        assert!(all > 300, "{all}");
        assert!(share > 0.97, "{points}: {share} of {all} within three standard errors");
        assert!((0.4..1.3).contains(&spread), "{points}: {spread}");
    }
}

/// The truth, as far as 64 times as many points tell it, lies within the errors.
#[test]
fn many_points_confirm_the_standard_errors_of_few() {
    let with = |seed, points| computed(&furnished(3), ViewFactorSettings { seed, points, ..by_facets() });
    let (few, many) = (with(5, 1024), with(6, 1 << 16));
    let (mut within, mut all) = (0, 0);
    for pair in &many.pairs {
        let (from, to) = (pair.from as usize, pair.to as usize);
        let ((a, of_a), (b, of_b)) = (factor(&few, from, to), factor(&many, from, to));
        if of_a > 1e-6 * a {
            all += 1;
            within += u32::from((a - b).abs() <= 3.0 * of_a.hypot(of_b));
        }
    }
    assert!(all > 300 && f64::from(within) >= 0.97 * f64::from(all), "{within} of {all}");
}

/// A surface's factor is the mean of its facets', weighted by area.
#[test]
fn facets_add_up_to_surfaces() {
    let scene = furnished(2);
    let (whole, parts) = (computed(&scene, ViewFactorSettings::default()), computed(&scene, by_facets()));
    assert_eq!(
        whole.rows.iter().map(|row| row.name.as_str()).collect::<Vec<_>>(),
        ["room", "standing", "hanging"]
    );
    let surface = |row: u32| {
        let name = &parts.rows[row as usize].name;
        let (name, _) = name.rsplit_once('/').unwrap();
        whole.rows.iter().position(|row| row.name == name).unwrap()
    };
    let mut sums = [[(0.0, 0.0); 3]; 3];
    for pair in &parts.pairs {
        let (from, to) = (surface(pair.from), surface(pair.to));
        for (from, to) in [(from, to), (to, from)] {
            sums[from][to].0 += pair.area;
            // Both ways within one surface are one number, counted twice.
            sums[from][to].1 += if from == to { 2.0 } else { 1.0 } * pair.variance;
        }
    }
    for (from, row) in sums.iter().enumerate() {
        for (to, (area, variance)) in row.iter().enumerate() {
            let (found, error) = factor(&whole, from, to);
            let expected = area / whole.rows[from].area;
            let limit = 4.0 * error.hypot(variance.sqrt() / whole.rows[from].area) + 1e-7;
            assert!((found - expected).abs() <= limit, "{from} {to}: {found} {expected} {limit}");
        }
        let own = (0_u32..).zip(&parts.rows).filter(|(index, _)| surface(*index) == from);
        let area: f64 = own.map(|(_, row)| row.area).sum();
        assert!((area - whole.rows[from].area).abs() < 1e-6 * area);
    }
    // The room sees itself, the convex boxes do not.
    assert!(factor(&whole, 0, 0).0 > 0.5);
    assert_eq!((factor(&whole, 1, 1).0, factor(&whole, 2, 2).0), (0.0, 0.0));
}

#[test]
fn threads_change_no_bit_and_the_seed_does() {
    let with = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| computed(&furnished(3), ViewFactorSettings { seed, ..by_facets() }))
    };
    assert!(with(1, 1) == with(3, 1));
    assert!(with(1, 1) != with(1, 2));
}
