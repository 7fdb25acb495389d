//! The solver on systems small enough to check by hand.

use std::convert::Infallible;

use glam::DVec3;
use kernel::row::Row;
use proptest::prelude::*;

use super::cache::{RowCache, SetId};
use super::shooting::Shooting;
use super::sweeps::{Transfer, solve};
use super::{ShareEnergy, ShareId};

/// A closed cube of six shares: a sixth of a unit area each, every share seeing the five others equally.
fn cube(reflectance: f64) -> (Vec<ShareEnergy>, Vec<Row>) {
    let share = |receiver| ShareEnergy { receiver, area: 1.0, reflectance: DVec3::splat(reflectance) };
    let row =
        |shooter| Row::new(&[0, 1, 2, 3, 4, 5].map(|receiver| if receiver == shooter { 0.0 } else { 0.2 }));
    ((0..6).map(share).collect(), (0..6).map(row).collect())
}

/// The only set of receivers.
const SET: SetId = SetId(0);

/// A cache of so many bytes for the rows of a cube.
fn cache(bytes: usize) -> RowCache {
    let mut cache = RowCache::new(bytes);
    assert_eq!(cache.add_set(6), SET);
    cache
}

/// Runs a shooting to its end, answering the wanted rows in the order that `pick` chooses: what was shot, and the numbers of
/// shots and of rows.
fn run(
    mut shooting: Shooting<DVec3>,
    rows: &[Row],
    mut cache: RowCache,
    mut pick: impl FnMut(usize) -> usize,
) -> (Vec<DVec3>, u64, u64) {
    let mut wanted = shooting.start(&cache);
    let mut answers = 0;
    while !shooting.is_done() {
        let share = wanted.swap_remove(pick(wanted.len()));
        wanted.extend(shooting.row_arrived(share, rows[share.index()].clone(), &mut cache));
        answers += 1;
    }
    let shots = shooting.progress().shots;
    (shooting.into_shot(), shots, answers)
}

#[test]
fn a_furnace_takes_few_sweeps_even_when_nearly_white() {
    for reflectance in [0.5, 0.9, 0.99, 0.999] {
        let (shares, mut rows) = cube(reflectance);
        let direct = vec![DVec3::ONE; 6];
        let guess = vec![DVec3::ZERO; 6];
        let solution = solve(&shares, &mut rows, direct, guess, 1e-9, 50).unwrap();
        for radiosity in &solution.radiosity {
            // Rows are in f32: 5 x 0.2 is not quite 1, and the furnace multiplies that by 1 / (1 - rho).
            let expected = reflectance / (1.0 - reflectance);
            assert!(
                (radiosity.x / expected - 1.0).abs() < 1e-7 / (1.0 - reflectance),
                "{reflectance}: {radiosity}"
            );
        }
        assert!(solution.missing <= 1e-9);
        // Without the level as a direction it would take some thousand sweeps at .999.
        assert!(solution.sweeps <= 20, "{} sweeps at {reflectance}", solution.sweeps);
    }
}

#[test]
fn sweeps_solve_an_uneven_enclosure() {
    let (shares, mut rows) = cube(0.9);
    let mut direct = vec![DVec3::ZERO; 6];
    direct[0] = DVec3::new(1.0, 2.0, 0.0);
    let solution = solve(&shares, &mut rows, direct.clone(), vec![DVec3::ZERO; 6], 1e-12, 500).unwrap();
    for (index, radiosity) in solution.radiosity.iter().enumerate() {
        let others: DVec3 = (0..6).map(|x| solution.radiosity[x] * f64::from(rows[x].factor(index))).sum();
        let expected = (direct[index] + others) * 0.9;
        assert!((*radiosity - expected).length() < 1e-10);
    }
    assert_eq!(solution.radiosity[3].z, 0.0);
}

#[test]
fn a_dim_room_beside_a_bright_one_is_solved_as_exactly() {
    let (mut shares, cubes) = cube(0.95);
    shares.extend(cube(0.6).0.into_iter().map(|share| ShareEnergy { receiver: share.receiver + 6, ..share }));
    let apart = |cube: &Row, first: usize| {
        Row::of_some(
            12,
            &cube.iter().map(|(receiver, factor)| (first + receiver, factor)).collect::<Vec<_>>(),
        )
    };
    let mut rows: Vec<Row> =
        [0, 6].into_iter().flat_map(|first| cubes.iter().map(move |row| apart(row, first))).collect();
    let mut direct = vec![DVec3::ZERO; 12];
    (direct[1], direct[7]) = (DVec3::splat(1e6), DVec3::ONE);
    let solution = solve(&shares, &mut rows, direct.clone(), vec![DVec3::ZERO; 12], 1e-9, 100).unwrap();
    assert!(solution.missing <= 1e-9 && solution.sweeps <= 20, "{} sweeps", solution.sweeps);
    for (index, share) in shares.iter().enumerate() {
        let others: DVec3 = (0..12).map(|x| solution.radiosity[x] * f64::from(rows[x].factor(index))).sum();
        let expected = share.reflectance * (direct[index] + others);
        assert!((solution.radiosity[index] / expected - 1.0).abs().max_element() < 1e-7, "share {index}");
    }
}

/// Rows handed over one by one.
struct OneByOne(Vec<Row>);

impl Transfer for OneByOne {
    type Error = Infallible;

    fn pass(&mut self, take: &mut dyn FnMut(usize, &[&Row])) -> Result<(), Infallible> {
        self.0.iter().enumerate().for_each(|(share, row)| take(share, &[row]));
        Ok(())
    }
}

#[test]
fn how_many_rows_come_at_once_changes_no_bit() {
    let (shares, mut rows) = cube(0.9);
    let direct: Vec<DVec3> = (0..6).map(|i| DVec3::new(f64::from(i).sqrt(), 0.3, 1.0)).collect();
    let start = vec![DVec3::ZERO; 6];
    let together = solve(&shares, &mut rows, direct.clone(), start.clone(), 1e-9, 50).unwrap();
    let apart = solve(&shares, &mut OneByOne(rows), direct, start, 1e-9, 50).unwrap();
    assert_eq!(together.radiosity, apart.radiosity);
}

#[test]
fn an_accuracy_beyond_rounding_ends() {
    let (shares, mut rows) = cube(0.99);
    let mut direct = vec![DVec3::ZERO; 6];
    direct[0] = DVec3::new(1.0, 0.7, 0.3);
    let solution = solve(&shares, &mut rows, direct, vec![DVec3::ZERO; 6], 0.0, 1000).unwrap();
    assert!(solution.sweeps < 50 && solution.missing < 1e-12, "{} sweeps", solution.sweeps);
}

#[test]
fn shots_are_no_more_than_a_sweep_has_rows() {
    // Two give nearly all to each other, and are brighter than the third to the last.
    let shares: Vec<ShareEnergy> =
        (0..3).map(|receiver| ShareEnergy { receiver, area: 1.0, reflectance: DVec3::splat(0.99) }).collect();
    let rows = [[0.0, 0.999, 0.001], [0.999, 0.0, 0.001], [0.001, 0.001, 0.0]].map(|row| Row::new(&row));
    let mut cache = RowCache::new(usize::MAX);
    assert_eq!(cache.add_set(3), SET);
    let direct = vec![DVec3::ONE, DVec3::ZERO, DVec3::ZERO];
    let (_, shots, _) = run(Shooting::new(shares, direct, SET, 1, 1e-9), &rows, cache, |_| 0);
    assert_eq!(shots, 3);
}

#[test]
fn shots_go_by_falling_flux_and_stop_with_all_rows() {
    let (shares, rows) = cube(0.5);
    let mut direct = vec![DVec3::ZERO; 6];
    direct[2] = DVec3::splat(10.0);
    direct[4] = DVec3::splat(1.0);
    let mut shooting = Shooting::new(shares, direct, SET, 1, 1e-9);
    let mut cache = cache(usize::MAX);
    assert_eq!(shooting.start(&cache), [ShareId(2)]);
    let next = shooting.row_arrived(ShareId(2), rows[2].clone(), &mut cache);
    assert_eq!(next, [ShareId(4)], "the share with direct light of its own has most left");
    assert_eq!(shooting.progress().shots, 1);
}

#[test]
fn a_second_copy_of_a_row_changes_nothing() {
    let (shares, rows) = cube(0.5);
    let mut shooting = Shooting::new(shares, vec![DVec3::ONE; 6], SET, 6, 1e-9);
    let mut cache = cache(usize::MAX);
    let wanted = shooting.start(&cache);
    assert_eq!(wanted.len(), 6);
    shooting.row_arrived(wanted[3], rows[wanted[3].index()].clone(), &mut cache);
    let before = shooting.progress();
    assert_eq!(shooting.row_arrived(wanted[3], Row::new(&[1.0; 6]), &mut cache), []);
    assert_eq!(shooting.progress(), before);
}

#[test]
fn darkness_shoots_nothing() {
    let (shares, _) = cube(0.9);
    let mut shooting = Shooting::new(shares, vec![DVec3::ZERO; 6], SET, 4, 1e-3);
    assert_eq!(shooting.start(&cache(0)), []);
    assert!(shooting.is_done());
}

proptest! {
    /// Shot n depends on the window alone: rows may arrive in any order, as they do from many workers.
    #[test]
    fn the_order_of_arrival_does_not_change_a_bit(
        light in prop::collection::vec(0.0..10.0, 6), window in 1_usize..8, order in prop::collection::vec(any::<usize>(), 64)) {
        let (shares, rows) = cube(0.8);
        let direct: Vec<DVec3> = light.into_iter().map(DVec3::splat).collect();
        let start = || Shooting::new(shares.clone(), direct.clone(), SET, window, 1e-6);
        let in_order = run(start(), &rows, cache(usize::MAX), |_| 0);
        let mut step = 0;
        let shuffled = run(start(), &rows, cache(usize::MAX), |count| { step += 1; order[step % order.len()] % count });
        prop_assert_eq!(in_order, shuffled);
    }

    /// What is kept changes how often rows are asked for, and nothing else; and what is asked for does not depend on timing.
    #[test]
    fn the_size_of_the_cache_does_not_change_a_bit(
        light in prop::collection::vec(0.0..10.0, 6), window in 1_usize..8, order in prop::collection::vec(any::<usize>(), 64)) {
        let (shares, rows) = cube(0.8);
        let direct: Vec<DVec3> = light.into_iter().map(DVec3::splat).collect();
        let start = || Shooting::new(shares.clone(), direct.clone(), SET, window, 1e-6);
        let (shot, shots, least) = run(start(), &rows, cache(usize::MAX), |_| 0);
        prop_assert!(least <= 6);
        for rows_kept in 0..3 {
            let some = || cache(rows_kept * rows[0].bytes());
            let in_order = run(start(), &rows, some(), |_| 0);
            prop_assert_eq!((&in_order.0, in_order.1), (&shot, shots));
            prop_assert!(in_order.2 >= least);
            let mut step = 0;
            let shuffled = run(start(), &rows, some(), |count| { step += 1; order[step % order.len()] % count });
            prop_assert_eq!(in_order, shuffled);
        }
        prop_assert_eq!(run(start(), &rows, cache(0), |_| 0).2, shots, "without a cache each shot asks for its row");
    }

    /// What the shares have shot never exceeds the solution, and the bound covers what is missing.
    #[test]
    fn shooting_stays_under_the_solution(light in prop::collection::vec(0.1..10.0, 6), threshold in 1e-3..0.5) {
        let (shares, mut rows) = cube(0.7);
        let direct: Vec<DVec3> = light.into_iter().map(DVec3::splat).collect();
        let exact = solve(&shares, &mut rows, direct.clone(), vec![DVec3::ZERO; 6], 1e-12, 500).unwrap();
        let (shot, ..) = run(Shooting::new(shares, direct, SET, 2, threshold), &rows, cache(usize::MAX), |_| 0);
        for (shot, exact) in shot.iter().zip(&exact.radiosity) {
            prop_assert!(shot.x <= exact.x * (1.0 + 1e-9));
        }
    }
}
