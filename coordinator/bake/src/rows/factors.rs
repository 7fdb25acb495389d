//! The factors between shares, in the form that sweeps ask for them.

use std::borrow::Cow;

use glam::DVec3;
use kernel::row::Row;
use rayon::prelude::*;

use super::means::{Means, Sums};
use super::table::{Handed, RowTable};
use super::vertices::COARSE;
use crate::error::{BakeError, Result};
use crate::jobs::RowClient;
use crate::solver::bounds::Bounds;
use crate::solver::cache::{ColumnCache, SetId};
use crate::solver::sweeps::{self, Transfer, solve};
use crate::solver::{Light, ShareEnergy, ShareId};

/// Sweeps end here even if the accuracy was not reached; the bound is reported.
const MAX_SWEEPS: u32 = 1000;

/// Columns that a thread makes at a time.
const COLUMNS_AT_ONCE: usize = 8;

/// The factors between shares, from the workers or from what is kept.
pub struct Factors<'a, 'b> {
    pub table: &'a mut RowTable,
    pub client: &'a mut RowClient<'b>,
    pub bounds: &'a Bounds,
    /// Where shares take means over the refined mesh rather than the value at their vertex.
    pub means: Option<&'a Means>,
    /// All vertices.
    pub sets: &'a [SetId],
    /// The means, as far as they are kept.
    pub columns: ColumnCache,
}

impl Transfer for Factors<'_, '_> {
    type Error = BakeError;

    fn pass(&mut self, take: &mut dyn FnMut(usize, &[&Row])) -> Result<()> {
        let bounds = self.bounds;
        let Some(means) = self.means else {
            return self.table.each(
                self.client,
                &[COARSE],
                |_| true,
                |handed| {
                    let rows = handed.iter().flat_map(|handed| &handed.rows);
                    let rows: Vec<&Row> = rows.copied().collect();
                    let bounded: Vec<Cow<Row>> = rows.par_iter().map(|row| bounds.row(0, row)).collect();
                    take(handed[0].share.index(), &bounded.iter().map(AsRef::as_ref).collect::<Vec<_>>());
                },
            );
        };
        let shares = self.table.shooters().len() as u32;
        let missing: Vec<bool> =
            (0..shares).map(|share| self.columns.column(ShareId(share)).is_none()).collect();
        let columns = &mut self.columns;
        self.table.each(
            self.client,
            self.sets,
            |share| missing[share.index()],
            |handed| {
                let made = made_columns(handed, means, bounds);
                let all = handed.iter().zip(&made);
                let all: Vec<&Row> =
                    all.filter_map(|(handed, made)| made.as_ref().or(columns.column(handed.share))).collect();
                take(handed[0].share.index(), &all);
                for (handed, column) in handed.iter().zip(made) {
                    if let Some(column) = column {
                        columns.keep(handed.share, column);
                    }
                }
            },
        )
    }
}

/// The columns of shares, of those that were handed over with rows.
fn made_columns(handed: &[Handed], means: &Means, bounds: &Bounds) -> Vec<Option<Row>> {
    let column = |sums: &mut Sums, handed: &Handed| {
        if handed.rows.is_empty() {
            return None;
        }
        if bounds.count() == 0 {
            return Some(sums.column(&handed.rows));
        }
        let starts = handed.rows.iter().scan(0, |next, row| {
            let start = *next;
            *next += row.receivers();
            Some(start)
        });
        let bounded: Vec<Cow<Row>> =
            starts.zip(&handed.rows).map(|(start, row)| bounds.row(start, row)).collect();
        Some(sums.column(&bounded.iter().map(AsRef::as_ref).collect::<Vec<_>>()))
    };
    if handed.iter().all(|handed| handed.rows.is_empty()) {
        return handed.iter().map(|_| None).collect();
    }
    handed.par_iter().with_min_len(COLUMNS_AT_ONCE).map_init(|| means.sums(), column).collect()
}

/// A solution in the colours of the scene.
pub fn solved<L: Light>(
    energies: &[ShareEnergy],
    transfer: &mut Factors,
    colour: DVec3,
    direct: &[DVec3],
    guess: &[DVec3],
    tolerance: f64,
) -> Result<sweeps::Solution<DVec3>> {
    let seen =
        |lights: &[DVec3]| -> Vec<L> { lights.iter().map(|light| L::from_rgb(*light, colour)).collect() };
    let energies: Vec<ShareEnergy<L>> = energies.iter().map(ShareEnergy::seen_as).collect();
    let solution = solve(&energies, transfer, seen(direct), seen(guess), tolerance, MAX_SWEEPS)?;
    Ok(solution.map(|light| light.to_rgb(colour)))
}
