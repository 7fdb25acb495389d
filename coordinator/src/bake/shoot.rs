//! Solving for the radiosity of the shares.

use std::collections::HashMap;

use glam::DVec3;
use shared::row::Row;

use super::channels::Channels;
use super::rows::RowOffice;
use super::settle::Means;
use super::share_rows::{COARSE, ShareRows};
use super::{Bake, BakeError, Phase};
use crate::solver::cache::{ColumnCache, SetId};
use crate::solver::shooting::Shooting;
use crate::solver::sweeps::{Transfer, solve};
use crate::solver::{Light, ShareEnergy, ShareId};

/// Shooting ends here at the latest: with all rows that matter at hand, sweeps finish faster than more shots would.
const LEAST_SHOOTING: f64 = 1e-3;

/// The rows under way while shooting are cut into so many jobs, for as many threads.
const JOBS_IN_WINDOW: usize = 16;

/// Sweeps end here even if the accuracy was not reached; the bound is reported.
const MAX_SWEEPS: u32 = 1000;

impl Bake<'_, '_> {
    /// Shooting, then sweeps over all rows, those too that no shot needed.
    pub(super) fn shoot(&mut self) -> Result<(), BakeError> {
        self.office.enter(Phase::Shoot, self.mesh.vertices.len());
        self.office.expect_rows(self.shares.len() as u64);
        let shot = match self.channels {
            Channels::One(colour) => self.shoot_as::<f64>(colour)?,
            Channels::Three => self.shoot_as::<DVec3>(DVec3::ONE)?,
        };
        self.look_at_rows(COARSE, |_, _| ())?;
        self.solve(self.energies.clone(), None, self.direct.clone(), shot)?;
        self.end_step("shoot");
        Ok(())
    }

    /// Shoots until little is left: the radiosity that each share has shot.
    fn shoot_as<L: Light>(&mut self, colour: DVec3) -> Result<Vec<DVec3>, BakeError> {
        let energies = self.energies.iter().map(ShareEnergy::seen_as).collect();
        let direct = self.direct.iter().map(|light| L::from_rgb(*light, colour)).collect();
        let threshold = self.settings.threshold.max(LEAST_SHOOTING);
        let mut shooting = Shooting::<L>::new(energies, direct, COARSE, self.settings.window, threshold);
        let mut wanted = shooting.start(self.rows.cache());
        // A job of several rows costs less than as many jobs, but every worker must find one in the window.
        let most = (self.settings.window / JOBS_IN_WINDOW).max(1);
        let per_job = self.rows.set(COARSE).shooters_per_job().min(most);
        let mut jobs = HashMap::new();
        while !shooting.is_done() {
            for shares in wanted.chunks(per_job) {
                let tag = u64::from(shares[0].0);
                self.office.submit(tag, self.rows.wish(COARSE, shares));
                jobs.insert(tag, shares.to_vec());
            }
            let (tag, finished) = self.office.next()?;
            let shares = jobs.remove(&tag).unwrap_or_default();
            wanted.clear();
            for ((share, row), statistics) in shares.into_iter().zip(finished.rows).zip(finished.statistics) {
                self.rows.made(COARSE, share, statistics.sampling_variance);
                wanted.extend(shooting.row_arrived(share, row, self.rows.cache()));
            }
            self.office.set_unshot(shooting.progress().unshot);
        }
        self.spent.shots += shooting.progress().shots;
        Ok(shooting.into_shot().into_iter().map(|light| light.to_rgb(colour)).collect())
    }

    /// Takes a first look at all rows over a set of vertices: what they sum to at the vertices of the shares, and which vertices
    /// see anything.
    pub(super) fn look_at_rows(
        &mut self,
        set: SetId,
        mut look: impl FnMut(ShareId, &Row),
    ) -> Result<(), BakeError> {
        let first = self.exposed.len();
        self.exposed.resize(first + self.rows.set(set).count(), false);
        let exposed = &mut self.exposed[first..];
        let mut sums = vec![0.0; if set == COARSE { exposed.len() } else { 0 }];
        let mut bytes = 0;
        self.rows.each(
            self.office,
            &[set],
            |_| true,
            |share, rows| {
                let Some(&[row]) = rows else { return };
                bytes += row.bytes();
                row.for_each(|receiver, _| exposed[receiver] = true);
                if set == COARSE {
                    row.for_each(|receiver, factor| sums[receiver] += f64::from(factor));
                }
                look(share, row);
            },
        )?;
        if set == COARSE {
            self.row_sums = self.energies.iter().map(|share| sums[share.receiver]).collect();
            self.coarse_bytes = bytes;
        }
        Ok(())
    }

    /// Solves for the radiosity of the shares and gathers the irradiance of all vertices: from the rows over the vertices of the
    /// shooting mesh, or from the `means` over the shares.
    pub(super) fn solve(
        &mut self,
        energies: Vec<ShareEnergy>,
        means: Option<&Means>,
        direct: Vec<DVec3>,
        guess: Vec<DVec3>,
    ) -> Result<(), BakeError> {
        // Sweeps go over the columns again and again, over the rows they are made of once: columns come first.
        let bytes = if means.is_some() { self.coarse_bytes + self.coarse_bytes / 4 } else { 0 };
        let reserved = self.rows.cache().reserve(bytes);
        let mut transfer = Factors {
            rows: &mut self.rows,
            office: self.office,
            means,
            sets: &self.vertex_sets,
            columns: ColumnCache::new(reserved, energies.len()),
        };
        let tolerance = self.settings.threshold;
        let solution = match self.channels {
            Channels::One(colour) => {
                solved::<f64>(&energies, &mut transfer, colour, &direct, &guess, tolerance)?
            }
            Channels::Three => {
                solved::<DVec3>(&energies, &mut transfer, DVec3::ONE, &direct, &guess, tolerance)?
            }
        };
        self.most_row_bytes =
            self.most_row_bytes.max(transfer.columns.bytes() + transfer.rows.cache().bytes());
        self.rows.cache().reserve(0);
        self.spent.sweeps += solution.sweeps;
        self.unshot_bound = solution.missing;
        self.residual = solution.residual;
        self.unshot = solution.unshot;
        self.office.set_unshot(solution.missing);
        self.radiosity = solution.radiosity;
        self.gather()
    }

    /// Gathers the irradiance of all vertices and guiding points from the radiosity of the shares.
    fn gather(&mut self) -> Result<(), BakeError> {
        let sets: Vec<SetId> = self.vertex_sets.iter().copied().chain(self.guide_set).collect();
        let mut gathered: Vec<_> =
            sets.iter().map(|set| self.channels.gathering(self.rows.set(*set).count())).collect();
        let radiosity = &self.radiosity;
        self.rows.each(
            self.office,
            &sets,
            |_| true,
            |share, rows| {
                for (gathered, row) in gathered.iter_mut().zip(rows.into_iter().flatten()) {
                    gathered.add(row, radiosity[share.index()]);
                }
            },
        )?;
        self.most_row_bytes = self.most_row_bytes.max(self.rows.cache().most_bytes());
        if self.guide_set.is_some()
            && let Some(gathered) = gathered.pop()
        {
            self.guides.set_gathered(gathered);
        }
        let gathered = gathered.into_iter().flat_map(|set| set.into_irradiance());
        self.irradiance = self.direct.iter().zip(gathered).map(|(direct, light)| *direct + light).collect();
        if self.irradiance.iter().all(|irradiance| irradiance.is_finite()) {
            Ok(())
        } else {
            Err(BakeError::NotFinite)
        }
    }
}

/// The factors between shares, from the workers or from what is kept.
struct Factors<'a, 'b> {
    rows: &'a mut ShareRows,
    office: &'a mut RowOffice<'b>,
    /// Where shares take means over the refined mesh rather than the value at their vertex.
    means: Option<&'a Means>,
    /// All vertices.
    sets: &'a [SetId],
    /// The means, as far as they are kept.
    columns: ColumnCache,
}

impl Transfer for Factors<'_, '_> {
    type Error = BakeError;

    fn pass(&mut self, take: &mut dyn FnMut(usize, &Row)) -> Result<(), BakeError> {
        let Some(means) = self.means else {
            return self.rows.each(
                self.office,
                &[COARSE],
                |_| true,
                |share, rows| {
                    rows.into_iter().flatten().for_each(|row| take(share.index(), row));
                },
            );
        };
        let shares = self.rows.shooters().len() as u32;
        let missing: Vec<bool> =
            (0..shares).map(|share| self.columns.column(ShareId(share)).is_none()).collect();
        let mut sums = means.sums();
        let columns = &mut self.columns;
        self.rows.each(
            self.office,
            self.sets,
            |share| missing[share.index()],
            |share, rows| {
                let made = rows.map(|rows| sums.column(rows));
                if let Some(column) = made.as_ref().or(columns.column(share)) {
                    take(share.index(), column);
                }
                if let Some(column) = made {
                    columns.keep(share, column);
                }
            },
        )
    }
}

/// A solution in the colours of the scene.
fn solved<L: Light>(
    energies: &[ShareEnergy],
    transfer: &mut Factors,
    colour: DVec3,
    direct: &[DVec3],
    guess: &[DVec3],
    tolerance: f64,
) -> Result<crate::solver::sweeps::Solution<DVec3>, BakeError> {
    let seen =
        |lights: &[DVec3]| -> Vec<L> { lights.iter().map(|light| L::from_rgb(*light, colour)).collect() };
    let energies: Vec<ShareEnergy<L>> = energies.iter().map(ShareEnergy::seen_as).collect();
    let solution = solve(&energies, transfer, seen(direct), seen(guess), tolerance, MAX_SWEEPS)?;
    Ok(solution.map(|light| light.to_rgb(colour)))
}
