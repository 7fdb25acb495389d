//! Solving for the radiosity of the shares.

use std::collections::{HashMap, HashSet, VecDeque};

use glam::DVec3;
use kernel::row::Row;

use super::channels::Channels;
use super::rows::RowOffice;
use super::settle::Means;
use super::share_rows::{COARSE, ShareRows};
use super::{Bake, BakeError, Phase};
use crate::mesh::Share;
use crate::solver::cache::{ColumnCache, SetId};
use crate::solver::shooting::Shooting;
use crate::solver::sweeps::{Transfer, solve};
use crate::solver::{Light, ShareEnergy, ShareId};

/// Shooting ends here at the latest: with all rows that matter at hand, sweeps finish faster than more shots would.
pub(super) const LEAST_SHOOTING: f64 = 1e-3;

/// The rows under way while shooting are cut into so many jobs at least,
const JOBS_IN_WINDOW: usize = 16;

/// and into so many for each thread: one that is computed, one that waits, one on its way.
const JOBS_PER_THREAD: usize = 3;

/// With rows that are made ahead of time, so many jobs are under way for each thread.
const JOBS_AHEAD_PER_THREAD: usize = 4;

/// Sweeps end here even if the accuracy was not reached; the bound is reported.
const MAX_SWEEPS: u32 = 1000;

impl Bake<'_, '_> {
    /// Shooting, then sweeps over all rows, those too that no shot needed.
    #[tracing::instrument(skip_all)]
    pub(super) fn shoot(&mut self) -> Result<(), BakeError> {
        self.office.enter(Phase::Shoot, self.mesh.vertices.len());
        if self.is_gathered {
            return self.start_from_receivers();
        }
        self.office.expect_rows(self.shares.len() as u64);
        let shot = match self.channels {
            Channels::One(colour) => self.shoot_as::<f64>(colour)?,
            Channels::Three => self.shoot_as::<DVec3>(DVec3::ONE)?,
        };
        self.look_at_rows(COARSE, |_, _| ())?;
        // Good enough to see where the mesh must be refined; once it is, the shares are solved for again.
        let tolerance = self.settings.threshold.max(LEAST_SHOOTING);
        self.solve(self.energies.clone(), None, self.direct.clone(), shot, tolerance)?;
        self.end_step("shoot");
        Ok(())
    }

    /// Shoots until little is left: the radiosity that each share has shot.
    ///
    /// The window bounds how many rows shooting waits for, and a row that is late holds it up. Sweeps will need all rows, so
    /// threads that would idle meanwhile make those that shooting did not ask for yet, as long as there is memory to keep
    /// them.
    fn shoot_as<L: Light>(&mut self, colour: DVec3) -> Result<Vec<DVec3>, BakeError> {
        let energies = self.energies.iter().map(ShareEnergy::seen_as).collect();
        let direct = self.direct.iter().map(|light| L::from_rgb(*light, colour)).collect();
        let threshold = self.settings.threshold.max(LEAST_SHOOTING);
        let mut shooting = Shooting::<L>::new(energies, direct, COARSE, self.settings.window, threshold);
        let mut unasked = shooting.by_unshot();
        let mut wanted = shooting.start(self.rows.cache());
        let mut jobs: HashMap<u64, Vec<ShareId>> = HashMap::new();
        let mut under_way: HashSet<ShareId> = HashSet::new();
        loop {
            wanted.retain(|share| !under_way.contains(share));
            let threads = self.office.threads();
            // A job of several rows costs less than as many jobs, but every thread must find some in the window.
            let jobs_in_window = JOBS_IN_WINDOW.max(JOBS_PER_THREAD * threads);
            let most = (self.settings.window / jobs_in_window).max(1);
            let per_job = self.office.most_shooters(self.rows.set(COARSE)).min(most);
            let mut next: Vec<Vec<ShareId>> = wanted.chunks(per_job).map(<[ShareId]>::to_vec).collect();
            wanted.clear();
            loop {
                for shares in next.drain(..) {
                    under_way.extend(&shares);
                    let tag = u64::from(shares[0].0);
                    self.office.submit(tag, self.rows.wish(COARSE, &shares));
                    jobs.insert(tag, shares);
                }
                if jobs.len() >= JOBS_AHEAD_PER_THREAD * threads {
                    break;
                }
                let ahead = self.ahead(&mut unasked, &under_way, |share| shooting.wants(share));
                if ahead.is_empty() {
                    break;
                }
                next.push(ahead);
            }
            if jobs.is_empty() {
                break;
            }
            let (tag, finished) = self.office.next()?;
            let shares = jobs.remove(&tag).unwrap_or_default();
            for ((share, row), statistics) in shares.into_iter().zip(finished.rows).zip(finished.statistics) {
                under_way.remove(&share);
                // A row of the same job may have had it chosen a moment ago.
                wanted.retain(|wanted| *wanted != share);
                self.rows.made(COARSE, share, statistics.sampling_variance);
                if shooting.wants(share) {
                    wanted.extend(shooting.row_arrived(share, row, self.rows.cache()));
                } else {
                    self.rows.cache().keep(COARSE, share, row);
                }
            }
            self.office.set_unshot(shooting.progress().unshot);
            if self.office.wants_present() {
                let seen = |lights: &[L]| lights.iter().map(|light| light.to_rgb(colour)).collect::<Vec<_>>();
                let lit = self.state(&seen(shooting.irradiance()), &seen(&shooting.unshot_of_shares()));
                self.office.present(lit);
            }
        }
        self.spent.shots += shooting.progress().shots;
        Ok(shooting.into_shot().into_iter().map(|light| light.to_rgb(colour)).collect())
    }

    /// The next shares whose rows are made ahead of time, taken from those that nobody asked for yet: none where all were, or
    /// where their rows might not be kept. What shooting wants it has, or has asked for.
    fn ahead(
        &mut self,
        unasked: &mut VecDeque<ShareId>,
        under_way: &HashSet<ShareId>,
        is_wanted: impl Fn(ShareId) -> bool,
    ) -> Vec<ShareId> {
        let set = self.rows.set(COARSE);
        let count = self.office.shooters_of_next_job(set, unasked.len());
        let room = self.rows.cache().room() / Row::most_bytes(set.count());
        let count = count.min(room.saturating_sub(under_way.len()));
        let mut ahead = vec![];
        while ahead.len() < count
            && let Some(share) = unasked.pop_front()
        {
            let is_there = is_wanted(share) || self.rows.cache().row(COARSE, share).is_some();
            if !is_there && !under_way.contains(&share) {
                ahead.push(share);
            }
        }
        ahead
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
        let looks = &self.looks;
        let mut bytes = 0;
        self.rows.each(
            self.office,
            &[set],
            |_| true,
            |share, rows| {
                let Some(&[row]) = rows else { return };
                bytes += row.bytes();
                if set == COARSE {
                    // What passes through a share comes from what is behind it.
                    let opacity = looks[share.index()].opacity;
                    row.for_each(|receiver, factor| {
                        exposed[receiver] = true;
                        sums[receiver] += f64::from(factor) * opacity;
                    });
                } else {
                    row.for_each(|receiver, _| exposed[receiver] = true);
                }
                look(share, row);
            },
        )?;
        if set == COARSE {
            self.row_sums = if self.is_gathered {
                let mean = |share: &Share| {
                    let corners = &self.mesh.patch(share.corners[0].0).corners;
                    corners.iter().map(|corner| sums[corner.index()]).sum::<f64>() / corners.len() as f64
                };
                self.shares.iter().map(mean).collect()
            } else {
                self.energies.iter().map(|share| sums[share.receiver]).collect()
            };
            self.coarse_bytes = bytes;
        }
        Ok(())
    }

    /// Solves for the radiosity of the shares and gathers the irradiance of all vertices.
    pub(super) fn solve(
        &mut self,
        energies: Vec<ShareEnergy>,
        means: Option<&Means>,
        direct: Vec<DVec3>,
        guess: Vec<DVec3>,
        tolerance: f64,
    ) -> Result<(), BakeError> {
        let columns = None;
        self.solve_shares(energies, means, columns, direct, guess, tolerance)?;
        self.gather()
    }

    /// Solves for the radiosity of the shares: from the rows over the vertices of the shooting mesh, or from the `means` over the
    /// shares, of which `columns` are known already. The columns for whoever solves with the same means again.
    pub(super) fn solve_shares(
        &mut self,
        energies: Vec<ShareEnergy>,
        means: Option<&Means>,
        columns: Option<ColumnCache>,
        direct: Vec<DVec3>,
        guess: Vec<DVec3>,
        tolerance: f64,
    ) -> Result<ColumnCache, BakeError> {
        // Sweeps go over the columns again and again, over the rows they are made of once: columns come first.
        let bytes = if means.is_some() { self.coarse_bytes + self.coarse_bytes / 4 } else { 0 };
        let reserved = self.rows.cache().reserve(bytes);
        let mut transfer = Factors {
            rows: &mut self.rows,
            office: self.office,
            means,
            sets: &self.vertex_sets,
            columns: columns.unwrap_or_else(|| ColumnCache::new(reserved, energies.len())),
        };
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
        let columns = transfer.columns;
        self.rows.cache().reserve(0);
        self.spent.sweeps += solution.sweeps;
        self.unshot_bound = solution.missing;
        self.residual = solution.residual;
        self.unshot = solution.unshot;
        self.office.set_unshot(solution.missing);
        self.radiosity = solution.radiosity;
        Ok(columns)
    }

    /// Gathers the irradiance of all vertices and guiding points from the radiosity of the shares.
    pub(super) fn gather(&mut self) -> Result<(), BakeError> {
        let sets: Vec<SetId> =
            self.vertex_sets.iter().copied().chain(self.guide_twins).chain(self.guide_set).collect();
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
        if self.guide_twins.is_some()
            && let Some(twins) = gathered.pop()
        {
            let differences = self.guides.differences(&twins.into_irradiance());
            self.ray_noise = self.guides.relative(differences.into_iter()) / std::f64::consts::SQRT_2;
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
