//! The solver on systems small enough to check by hand.

use glam::DVec3;
use proptest::prelude::*;

use super::shooting::Shooting;
use super::sweeps::{Transfer, solve};
use super::{ShareEnergy, ShareId};

/// A closed cube of six shares: a sixth of a unit area each, every share seeing the five others equally.
fn cube(reflectance: f64) -> (Vec<ShareEnergy>, Vec<Vec<f32>>) {
    let share = |receiver| ShareEnergy { receiver, area: 1.0, reflectance: DVec3::splat(reflectance) };
    let row = |shooter: usize| (0..6).map(|receiver| if receiver == shooter { 0.0 } else { 0.2 }).collect();
    ((0..6).map(share).collect(), (0..6).map(row).collect())
}

/// Runs a shooting to its end, answering the wanted rows in the order that `pick` chooses.
fn run(
    mut shooting: Shooting<DVec3>,
    rows: &[Vec<f32>],
    mut pick: impl FnMut(usize) -> usize,
) -> (Vec<DVec3>, u64) {
    let mut wanted = shooting.start();
    while !shooting.is_done() {
        let share = wanted.swap_remove(pick(wanted.len()));
        wanted.extend(shooting.row_arrived(share, rows[share.index()].clone()));
    }
    let shots = shooting.progress().shots;
    (shooting.into_parts().0, shots)
}

#[test]
fn a_furnace_takes_few_sweeps_even_when_nearly_white() {
    for reflectance in [0.5, 0.9, 0.99, 0.999] {
        let (shares, columns) = cube(reflectance);
        let direct = vec![DVec3::ONE; 6];
        let guess = vec![DVec3::ZERO; 6];
        let solution = solve(&shares, &Transfer { columns }, &direct, guess, 1e-9, 50);
        for radiosity in &solution.radiosity {
            // Rows are in f32: 5 x 0.2 is not quite 1, and the furnace multiplies that by 1 / (1 - rho).
            let expected = reflectance / (1.0 - reflectance);
            assert!(
                (radiosity.x / expected - 1.0).abs() < 1e-7 / (1.0 - reflectance),
                "{reflectance}: {radiosity}"
            );
        }
        assert!(solution.missing <= 1e-9);
        // Without the correction of the level it would take some thousand sweeps at .999.
        assert!(solution.sweeps <= 20, "{} sweeps at {reflectance}", solution.sweeps);
    }
}

#[test]
fn sweeps_solve_an_uneven_enclosure() {
    let (shares, columns) = cube(0.9);
    let mut direct = vec![DVec3::ZERO; 6];
    direct[0] = DVec3::new(1.0, 2.0, 0.0);
    let transfer = Transfer { columns };
    let solution = solve(&shares, &transfer, &direct, vec![DVec3::ZERO; 6], 1e-12, 500);
    for (index, radiosity) in solution.radiosity.iter().enumerate() {
        let others: DVec3 =
            (0..6).map(|x| solution.radiosity[x] * f64::from(transfer.columns[x][index])).sum();
        let expected = (direct[index] + others) * 0.9;
        assert!((*radiosity - expected).length() < 1e-10);
    }
    assert_eq!(solution.radiosity[3].z, 0.0);
}

#[test]
fn shots_go_by_falling_flux_and_stop_with_all_rows() {
    let (shares, rows) = cube(0.5);
    let mut direct = vec![DVec3::ZERO; 6];
    direct[2] = DVec3::splat(10.0);
    direct[4] = DVec3::splat(1.0);
    let mut shooting = Shooting::new(shares, direct, 1, 1e-9);
    assert_eq!(shooting.start(), [ShareId(2)]);
    let next = shooting.row_arrived(ShareId(2), rows[2].clone());
    assert_eq!(next, [ShareId(4)], "the share with direct light of its own has most left");
    assert_eq!(shooting.progress().shots, 1);
}

#[test]
fn a_second_copy_of_a_row_changes_nothing() {
    let (shares, rows) = cube(0.5);
    let mut shooting = Shooting::new(shares, vec![DVec3::ONE; 6], 6, 1e-9);
    let wanted = shooting.start();
    assert_eq!(wanted.len(), 6);
    shooting.row_arrived(wanted[3], rows[wanted[3].index()].clone());
    let before = shooting.progress();
    assert_eq!(shooting.row_arrived(wanted[3], vec![1.0; 6]), []);
    assert_eq!(shooting.progress(), before);
}

#[test]
fn darkness_shoots_nothing() {
    let (shares, _) = cube(0.9);
    let mut shooting = Shooting::new(shares, vec![DVec3::ZERO; 6], 4, 1e-3);
    assert_eq!(shooting.start(), []);
    assert!(shooting.is_done());
}

proptest! {
    /// Shot n depends on the window alone: rows may arrive in any order, as they do from many workers.
    #[test]
    fn the_order_of_arrival_does_not_change_a_bit(
        light in prop::collection::vec(0.0..10.0, 6), window in 1_usize..8, order in prop::collection::vec(any::<usize>(), 64)) {
        let (shares, rows) = cube(0.8);
        let direct: Vec<DVec3> = light.into_iter().map(DVec3::splat).collect();
        let start = || Shooting::new(shares.clone(), direct.clone(), window, 1e-6);
        let in_order = run(start(), &rows, |_| 0);
        let mut step = 0;
        let shuffled = run(start(), &rows, |count| { step += 1; order[step % order.len()] % count });
        prop_assert_eq!(in_order, shuffled);
    }

    /// What the shares have shot never exceeds the solution, and the bound covers what is missing.
    #[test]
    fn shooting_stays_under_the_solution(light in prop::collection::vec(0.1..10.0, 6), threshold in 1e-3..0.5) {
        let (shares, rows) = cube(0.7);
        let direct: Vec<DVec3> = light.into_iter().map(DVec3::splat).collect();
        let exact = solve(&shares, &Transfer { columns: rows.clone() }, &direct, vec![DVec3::ZERO; 6], 1e-12, 500);
        let (shot, _) = run(Shooting::new(shares, direct, 2, threshold), &rows, |_| 0);
        for (shot, exact) in shot.iter().zip(&exact.radiosity) {
            prop_assert!(shot.x <= exact.x * (1.0 + 1e-9));
        }
    }
}
