//! Solving for the radiosity of the shares.

use glam::DVec3;
use shared::row::Shooter;

use super::{Bake, BakeError, Phase};
use crate::solver::shooting::Shooting;
use crate::solver::sweeps::{Transfer, solve};
use crate::solver::{ShareId, add_row};

/// Accuracy to which sweeps solve, relative to the reflected flux: far below every other error.
const SWEEP_TOLERANCE: f64 = 1e-7;

/// Sweeps end here even if the accuracy was not reached; the bound is reported.
const MAX_SWEEPS: u32 = 1000;

impl Bake<'_> {
    /// Shooting, then the rows that no shot needed, then sweeps.
    pub(super) fn shoot(&mut self) -> Result<(), BakeError> {
        self.office.enter(Phase::Shoot, self.mesh.vertices.len());
        self.office.expect_rows(self.shooters.len() as u64);
        let threshold = self.settings.threshold;
        let mut shooting =
            Shooting::new(self.energies.clone(), self.direct.clone(), self.settings.window, threshold);
        let mut wanted = shooting.start();
        while !shooting.is_done() {
            for share in wanted.drain(..) {
                let shooter = self.shooters[share.index()].clone();
                self.office.submit(u64::from(share.0), vec![shooter], self.coarse);
            }
            let (tag, mut rows) = self.office.next()?;
            wanted = shooting.row_arrived(ShareId(tag as u32), rows.pop().unwrap_or_default());
            self.office.set_unshot(shooting.progress().unshot);
        }
        self.shots = shooting.progress().shots;
        let (shot, rows) = shooting.into_parts();
        self.rows = self.missing_rows(rows)?;
        let transfer = Transfer {
            columns: self
                .rows
                .iter()
                .map(|row| self.energies.iter().map(|share| row[share.receiver]).collect())
                .collect(),
        };
        self.row_sums = (0..self.shares.len())
            .map(|share| transfer.columns.iter().map(|column| f64::from(column[share])).sum())
            .collect();
        let direct: Vec<DVec3> = self.energies.iter().map(|share| self.direct[share.receiver]).collect();
        self.solve(&transfer, &direct, shot)?;
        self.end_step("shoot");
        Ok(())
    }

    /// Rows of the shares that shooting did not need: dark ones, which the row sums need all the same.
    fn missing_rows(&mut self, rows: Vec<Option<Vec<f32>>>) -> Result<Vec<Vec<f32>>, BakeError> {
        let missing: Vec<usize> = (0..rows.len()).filter(|index| rows[*index].is_none()).collect();
        let shooters: Vec<Shooter> = missing.iter().map(|index| self.shooters[*index].clone()).collect();
        let made = self.office.rows(&shooters, self.coarse)?;
        let mut rows: Vec<Vec<f32>> = rows.into_iter().map(Option::unwrap_or_default).collect();
        for (index, row) in missing.into_iter().zip(made) {
            rows[index] = row;
        }
        Ok(rows)
    }

    /// Solves for the radiosity of the shares and gathers the irradiance of all vertices.
    pub(super) fn solve(
        &mut self,
        transfer: &Transfer,
        direct: &[DVec3],
        guess: Vec<DVec3>,
    ) -> Result<(), BakeError> {
        let solution = solve(&self.energies, transfer, direct, guess, SWEEP_TOLERANCE, MAX_SWEEPS);
        self.sweeps += solution.sweeps;
        self.unshot_bound = solution.missing;
        self.unshot = solution.unshot;
        self.office.set_unshot(solution.missing);
        self.radiosity = solution.radiosity;
        self.irradiance = self.direct.clone();
        for (row, radiosity) in self.rows.iter().zip(&self.radiosity) {
            add_row(&mut self.irradiance, row, *radiosity);
        }
        if self.irradiance.iter().all(|irradiance| irradiance.is_finite()) {
            Ok(())
        } else {
            Err(BakeError::NotFinite)
        }
    }
}
