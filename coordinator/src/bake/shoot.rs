//! Solving for the radiosity of the shares.

use glam::DVec3;
use shared::row::Shooter;

use super::channels::Channels;
use super::checks::Checks;
use super::{Bake, BakeError, Phase, light};
use crate::solver::shooting::Shooting;
use crate::solver::sweeps::{Transfer, solve};
use crate::solver::{Light, ShareEnergy, ShareId};

/// Shooting ends here at the latest: with all rows that matter at hand, sweeps finish faster than more shots would.
const LEAST_SHOOTING: f64 = 1e-3;

/// Sweeps end here even if the accuracy was not reached; the bound is reported.
const MAX_SWEEPS: u32 = 1000;

/// Radiosity that each share has shot, and the rows of those that have.
type Shot = (Vec<DVec3>, Vec<Option<Vec<f32>>>);

impl Bake<'_, '_> {
    /// Shooting, then the rows that no shot needed, then sweeps.
    pub(super) fn shoot(&mut self) -> Result<(), BakeError> {
        self.office.enter(Phase::Shoot, self.mesh.vertices.len());
        self.office.expect_rows(self.shooters.len() as u64);
        let (shot, rows) = match self.channels {
            Channels::One(colour) => self.shoot_as::<f64>(colour)?,
            Channels::Three => self.shoot_as::<DVec3>(DVec3::ONE)?,
        };
        self.rows = self.missing_rows(rows)?;
        let mut guides = std::mem::take(&mut self.guides);
        self.light_checks(&mut guides)?;
        self.guides = guides;
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

    /// Shoots until little is left: the radiosity that each share has shot, and the rows so far.
    fn shoot_as<L: Light>(&mut self, colour: DVec3) -> Result<Shot, BakeError> {
        let energies = self.energies.iter().map(ShareEnergy::seen_as).collect();
        let direct = self.direct.iter().map(|light| L::from_rgb(*light, colour)).collect();
        let threshold = self.settings.threshold.max(LEAST_SHOOTING);
        let mut shooting = Shooting::<L>::new(energies, direct, self.settings.window, threshold);
        let mut wanted = shooting.start();
        while !shooting.is_done() {
            for share in wanted.drain(..) {
                let shooter = self.shooters[share.index()].clone();
                self.office.submit(u64::from(share.0), vec![shooter], self.coarse);
            }
            let (tag, mut finished) = self.office.next()?;
            wanted = shooting.row_arrived(ShareId(tag as u32), finished.rows.pop().unwrap_or_default());
            self.office.set_unshot(shooting.progress().unshot);
        }
        self.spent.shots += shooting.progress().shots;
        let (shot, rows) = shooting.into_parts();
        Ok((shot.into_iter().map(|light| light.to_rgb(colour)).collect(), rows))
    }

    /// Rows of all light sources and shares over the check points.
    pub(super) fn light_checks(&mut self, checks: &mut Checks) -> Result<(), BakeError> {
        let count = checks.count();
        if count == 0 {
            return Ok(());
        }
        let set = self.office.publish_receivers(&checks.receivers(count));
        let sources = self.sources.iter().map(|source| source.shooter.clone());
        let shooters: Vec<Shooter> = self.shooters.iter().cloned().chain(sources).collect();
        let (mut rows, variances) = self.office.rows_with_variances(&shooters, set)?;
        self.office.release_receivers(set);
        let lit = rows.split_off(self.shares.len());
        let mut direct = vec![DVec3::ZERO; count];
        light::add(&mut direct, &self.sources, &lit);
        checks.set_rows(direct, rows, variances);
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
        match self.channels {
            Channels::One(colour) => self.solve_as::<f64>(colour, transfer, direct, guess),
            Channels::Three => self.solve_as::<DVec3>(DVec3::ONE, transfer, direct, guess),
        }
        let radiosities = self.radiosity.iter().copied();
        self.guides.gather(radiosities.clone(), self.channels);
        self.irradiance = self.direct.clone();
        self.channels.gather(&mut self.irradiance, self.rows.iter().zip(radiosities));
        if self.irradiance.iter().all(|irradiance| irradiance.is_finite()) {
            Ok(())
        } else {
            Err(BakeError::NotFinite)
        }
    }

    fn solve_as<L: Light>(
        &mut self,
        colour: DVec3,
        transfer: &Transfer,
        direct: &[DVec3],
        guess: Vec<DVec3>,
    ) {
        let seen =
            |lights: &[DVec3]| -> Vec<L> { lights.iter().map(|light| L::from_rgb(*light, colour)).collect() };
        let energies: Vec<ShareEnergy<L>> = self.energies.iter().map(ShareEnergy::seen_as).collect();
        let tolerance = self.settings.threshold;
        let solution = solve(&energies, transfer, &seen(direct), seen(&guess), tolerance, MAX_SWEEPS);
        self.spent.sweeps += solution.sweeps;
        self.unshot_bound = solution.missing;
        self.residual = solution.residual;
        self.unshot = solution.unshot.to_rgb(colour);
        self.office.set_unshot(solution.missing);
        self.radiosity = solution.radiosity.into_iter().map(|light| light.to_rgb(colour)).collect();
    }
}
