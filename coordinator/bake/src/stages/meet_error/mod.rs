//! Refining and measuring until the error is met.

use super::measure::Measured;
use super::refine::{Aim, UNSEEN_STEP};
use super::shooting_mesh::ShootingMesh;
use super::solved::Solved;
use crate::context::Context;
use crate::error::Result;
use crate::error_budget::without;
use crate::refinement::{Obstacle, room};
use crate::settings::BakeSettings;
use crate::solver::balance::EnergyBalance;

/// Part of the asked error that the shooters may take after a new start.
const SHOOTERS_PART: f64 = 0.5;

/// Part of the asked error from which on shooters follow the mesh where that costs no rows.
const FOLLOWED_PART: f64 = 0.3;

/// Part of the asked error that the rays may take after a new start.
const RAYS_PART: f64 = 0.3;

/// Noise that is less than this part of the error found hides little of it: what else refinement did not find, as small bright spots,
/// more rays will not show either.
const HIDING_PART: f64 = 1.0 / 3.0;

/// What is left to the interpolation is aimed at with this margin.
const MARGIN: f64 = 0.9;

/// Part of what an asked error leaves to interpolation that refinement aims at first, where rows are exact: vertices cost least there, and pictures
/// show errors that the sum over all surfaces does not.
const PART_OF_ASKED: f64 = 0.4;

/// The interpolation must be left this part of the asked error at least: else it would have to pay for others.
const LEAST_REST: f64 = 0.4;

/// Part of the interpolation error that is aimed at, at least, before it is measured again: the finer mesh tells better what the
/// others leave to it, and vertices too many cannot be taken back.
const LONGEST_STEP: f64 = 0.6;

/// A round may add this times as many vertices as the error asks for, where it falls with the square root of those added: the
/// prediction of a noisy scene may never reach its limit.
const SPARE_VERTICES: f64 = 1.5;

/// Vertices that a round may add whatever the error.
const FREE_VERTICES: usize = 1000;

/// Refining and measuring are repeated this often at most.
const MAX_ROUNDS: u32 = 12;

/// Part of the emitted flux that may be missing, or too much, where an error is said to be met. Samples may miss small bright places;
/// the balance does not.
const IMBALANCE: f64 = 0.02;

/// Most rounds for the sake of the balance alone: not every imbalance is one of interpolation.
const ROUNDS_FOR_BALANCE: u32 = 4;

/// Part of the asked error from which on light between gather points gets more of them where the error is not met,
const MUCH_BETWEEN: f64 = 0.6;

/// this often at most.
const MOST_ADDITIONS: u32 = 3;

/// Most new starts.
const MAX_RESTARTS: u32 = 3;

impl Solved {
    /// Refines and measures, until the asked error is met or limited by something else than interpolation. Returns settings for a
    /// new start, too, where those should meet it.
    pub fn meet_error(self, cx: &mut Context) -> Result<(Measured, Option<BakeSettings>)> {
        let mut solved = self;
        let is_exact = solved.rows.source.leaves_cost_rows();
        let part = if is_exact && cx.settings.error.is_some() { PART_OF_ASKED } else { 1.0 };
        let limit = MARGIN * part * cx.settings.mesh_error;
        let mut aim = Aim { limit, least_vertices: 0, most_vertices: usize::MAX };
        solved.divide_long(cx)?;
        let first_vertices = solved.mesh.mesh.vertices.len();
        let mut round = 1;
        let mut rounds_for_balance = 0;
        let mut shooters = None;
        let mut additions = 0;
        loop {
            let own_limit = aim.limit;
            let mut measured = solved.refine(cx, &mut aim)?.measure(cx, shooters)?;
            if measured.shooters_should_follow(cx.settings) {
                if shooters.is_some() {
                    measured = measured.measure_shooters(cx)?;
                }
                measured = measured.follow_mesh(cx)?;
                shooters = None;
            }
            if additions < MOST_ADDITIONS
                && measured.is_limited_between(cx.settings)
                && measured.solved.add_gather_points(cx, &measured.found_between)?
            {
                additions += 1;
                // The light is new, and the mesh may be fine enough for it.
                aim = Aim { limit: own_limit, least_vertices: 0, ..aim };
                shooters = Some([measured.error.shooters, measured.shooters_at_least]);
                solved = measured.solved;
                continue;
            }
            let is_last = round == MAX_ROUNDS;
            let mut better = measured.better_settings(cx, is_last);
            // Noise of rays is no reason for more vertices.
            let may_balance = cx.settings.error.is_some()
                && rounds_for_balance < ROUNDS_FOR_BALANCE
                && measured.solved.rows.source.leaves_cost_rows();
            let needs_balance =
                |measured: &Measured, cx: &Context| may_balance && !is_balanced(&measured.solved.balance(cx));
            let is_end = |measured: &Measured, better: &Option<BakeSettings>, cx: &Context| {
                is_last
                    || measured.is_enough(cx.settings)
                        && (measured.obstacle.is_some() || !needs_balance(measured, cx))
                    || measured.others_take_all(cx.settings) && better.is_some()
            };
            if shooters.is_some() && is_end(&measured, &better, cx) {
                measured = measured.measure_shooters(cx)?;
                if measured.is_missed(cx.settings) && measured.shooters_should_follow(cx.settings) {
                    measured = measured.follow_mesh(cx)?;
                }
                better = measured.better_settings(cx, is_last);
            }
            if is_end(&measured, &better, cx) {
                return Ok((measured, better));
            }
            let of_mesh = measured.of_mesh();
            let limit = if measured.is_enough(cx.settings) {
                rounds_for_balance += 1;
                UNSEEN_STEP * aim.limit.min(of_mesh)
            } else {
                (MARGIN * measured.aim_for_mesh(cx.settings)).max(LONGEST_STEP * of_mesh)
            };
            let vertices = measured.solved.mesh.mesh.vertices.len();
            let asked = if measured.finer_mesh_helps_shooters(cx.settings) {
                // Twice as many: their error is taken to fall as that of edges half as long, where light changes.
                vertices
            } else {
                vertices_asked_for(vertices - first_vertices, of_mesh / limit)
            };
            aim = Aim {
                limit,
                // Exact rows cost more than measuring does, and there the error falls faster.
                least_vertices: vertices.saturating_add(if is_exact { 1 } else { asked.max(1) }),
                most_vertices: (vertices + FREE_VERTICES)
                    .saturating_add((SPARE_VERTICES * asked as f64) as usize),
            };
            shooters = Some([measured.error.shooters, measured.shooters_at_least]);
            solved = measured.solved;
            round += 1;
        }
    }
}

/// How many more vertices bring an error of `over` limits under its limit, where `added` have been added before: it falls with the square
/// root of their number.
fn vertices_asked_for(added: usize, over: f64) -> usize {
    ((over * over - 1.0).max(0.0) * added as f64) as usize
}

impl Measured {
    /// Whether more vertices are of no use: the error is met, or something else limits it.
    fn is_enough(&self, settings: &BakeSettings) -> bool {
        let is_met = self.error.receivers <= self.rest_for_receivers(settings) || self.is_predicted();
        let limited_by_others = self.others_take_all(settings)
            && self.of_mesh() <= self.aim_for_mesh(settings)
            && !self.finer_mesh_helps_shooters(settings);
        is_met || limited_by_others || self.obstacle.is_some()
    }

    /// Whether light between gather points is a large part of an error that is not met, and others leave something to it, or will once
    /// shooters follow a finer mesh.
    fn is_limited_between(&self, settings: &BakeSettings) -> bool {
        let asked = settings.asked_error();
        let shooters = if self.shooters_may_follow() { 0.0 } else { self.error.shooters };
        self.is_missed(settings)
            && self.between > MUCH_BETWEEN * asked
            && self.error.with_shooters(shooters).without_receivers() < asked
    }

    /// Whether an error was asked for, and more is estimated.
    fn is_missed(&self, settings: &BakeSettings) -> bool {
        settings.error.is_some_and(|asked| self.error.total > asked)
    }

    /// The error of interpolation on the mesh.
    fn of_mesh(&self) -> f64 {
        without(self.error.receivers, self.between)
    }

    /// Whether shooters are the main reason why the error is missed, and follow a finer mesh.
    fn finer_mesh_helps_shooters(&self, settings: &BakeSettings) -> bool {
        let others = self.error.with_shooters(0.0).without_receivers().hypot(self.between);
        self.is_missed(settings)
            && self.others_take_all(settings)
            && others < self.error.shooters.min(settings.asked_error())
            && self.shooters_may_follow()
    }

    /// Whether the mesh can be refined, and shooters follow it at no cost of rows.
    fn shooters_may_follow(&self) -> bool {
        !self.solved.rows.source.leaves_cost_rows() && self.obstacle.is_none()
    }

    /// Whether the shooters take so much of the asked error that they should follow the mesh, and can.
    fn shooters_should_follow(&self, settings: &BakeSettings) -> bool {
        self.error.shooters > FOLLOWED_PART * settings.asked_error() && self.solved.can_follow_mesh()
    }

    /// Whether the other parts of the error leave next to nothing to interpolation on the mesh.
    fn others_take_all(&self, settings: &BakeSettings) -> bool {
        settings.error.is_some_and(|asked| self.rest_for_mesh(settings) < LEAST_REST * asked)
    }

    /// The error of interpolation on the mesh that refinement aims at. Where others leave next to nothing, it may be as large as they
    /// are: vertices help until then.
    fn aim_for_mesh(&self, settings: &BakeSettings) -> f64 {
        let rest = self.rest_for_mesh(settings);
        if self.others_take_all(settings) {
            rest.max(self.error.without_receivers().hypot(self.between))
        } else {
            rest
        }
    }

    /// What the other parts of the error leave to the interpolation.
    fn rest_for_receivers(&self, settings: &BakeSettings) -> f64 {
        settings.error.map_or(settings.mesh_error, |asked| without(asked, self.error.without_receivers()))
    }

    /// What the other parts of the error leave to interpolation on the mesh.
    fn rest_for_mesh(&self, settings: &BakeSettings) -> f64 {
        without(self.rest_for_receivers(settings), self.between)
    }

    /// Whether the error is predicted for want of samples.
    fn is_predicted(&self) -> bool {
        self.solved.solution.samples.count() == 0
    }

    /// Settings that should meet the asked error where these did not; `None` when it is met, or cannot be. A new start costs as much
    /// as all before it: it is made where all but the interpolation certainly exceeds what was asked. Measured at some thousand
    /// points, of which few may hold most of it, chance would decide else. A finer mesh is tried first, unless this round is the last.
    fn better_settings(&self, cx: &Context, is_last: bool) -> Option<BakeSettings> {
        let asked = cx.settings.error?;
        if self.error.total <= asked || cx.work.restarts >= MAX_RESTARTS {
            return None;
        }
        let error = &self.error;
        // No new start has more vertices or gather points. Less noise shows whether more are needed.
        let noise_hides = self.obstacle == Some(Obstacle::Noise)
            && error.visibility > HIDING_PART * error.receivers
            && error.receivers >= error.shooters;
        let has_room = room(&self.solved.mesh.mesh, cx.settings.most_vertices(cx.scene)) > 0;
        if !has_room && !noise_hides && error.receivers > asked {
            return None;
        }
        let certainly = error.with_shooters(error.shooters.min(self.shooters_at_least));
        let rest_is_too_small = certainly.without_receivers() > asked;
        let most = error.unshot.max(error.form_factors);
        let better = cx.settings.clone();
        let better = if noise_hides || (rest_is_too_small && error.visibility > error.shooters.max(most)) {
            let factor = (error.visibility / (RAYS_PART * asked)).powf(4.0 / 3.0).max(1.5);
            let rays = self.solved.rows.source.rays(cx.settings);
            better.with_rays(f64::from(rays) * factor)
        } else if rest_is_too_small
            && error.shooters > most
            && (is_last || !self.finer_mesh_helps_shooters(cx.settings))
        {
            // Edges are halved: a factor of more than a half might change nothing.
            let factor = (SHOOTERS_PART * asked / error.shooters).clamp(0.25, 0.5);
            let finer = better.with_shooter_edge(cx.settings.shooter_edge * factor);
            let same = BakeSettings { rows: self.solved.rows.source.strategy(), ..finer.clone() };
            let mesh = ShootingMesh::new(cx.scene, &same).mesh;
            let vertices = mesh.vertices.len();
            let now = self.solved.rows.table.vertices.coarse_count();
            if vertices <= now || vertices > finer.most_vertices(cx.scene) {
                return None;
            }
            finer
        } else {
            return None;
        };
        (better != *cx.settings).then_some(better)
    }

    /// Why the asked error is not met, in words for the user.
    pub fn describe_obstacle(&self, cx: &Context) -> Option<String> {
        let settings = cx.settings;
        if settings.error.is_some() && self.is_predicted() {
            let why = if settings.validation_samples > 0 {
                "no surface reflects diffuse light"
            } else {
                "give --validation-samples"
            };
            return Some(format!("the error asked for was predicted, not measured: {why}"));
        }
        let asked = settings.asked_error();
        let estimate = if settings.error.is_some() { self.error.total } else { self.error.receivers };
        if estimate <= asked {
            return None;
        }
        let error = &self.error;
        let interpolation = "interpolation between the vertices";
        let receivers = if self.between > self.of_mesh() {
            "light between gather points, of which a bake has a limited number: for a small scene give --rows exact"
                .to_owned()
        } else {
            self.obstacle
                .map_or(interpolation.to_owned(), |cause| format!("{interpolation}: {}", cause.describe()))
        };
        let parts = [
            (error.receivers, receivers),
            (error.shooters, "the size of the shooting patches: raise --max-vertices, or give a finer --shooter-edge with --mesh-error".to_owned()),
            (error.visibility, "sampled visibility: raise --rays or --exact-occluders".to_owned()),
            (error.form_factors, "the arithmetic of form factors: lower --form-factor-error and --factor-rounding".to_owned()),
            (error.unshot, "unshot light: lower --threshold".to_owned()),
        ];
        let (_, part) = if settings.error.is_some() {
            parts.into_iter().reduce(|a, b| if b.0 > a.0 { b } else { a })?
        } else {
            parts.into_iter().next()?
        };
        Some(format!(
            "an error of {:.2} % was asked for and {:.2} % is estimated: limited by {part}",
            100.0 * asked,
            100.0 * estimate
        ))
    }

    /// What the balance tells that the estimated error does not, in words for the user.
    pub fn describe_imbalance(&self, cx: &Context, balance: &EnergyBalance) -> Option<String> {
        let asked = cx.settings.error.map(|asked| (asked, self.error.total <= asked));
        (!is_balanced(balance)).then(|| imbalance(balance.relative_imbalance(), asked, self.obstacle))
    }
}

/// The imbalance in words. `asked`: the error asked for, if any, and whether it is met as far as was estimated.
fn imbalance(relative: f64, asked: Option<(f64, bool)>, obstacle: Option<Obstacle>) -> String {
    let what = if relative > 0.0 { "missing" } else { "too much" };
    let light = format!("{:.1} % of the emitted light is {what}", 100.0 * relative.abs());
    match asked {
        None => format!("{light}: the error may be larger than is said; lower --mesh-error"),
        // Another warning says why.
        Some((_, false)) => format!("{light}: the error may be larger than is said"),
        Some((asked, true)) => {
            let asked = 100.0 * asked;
            let cure = obstacle.and_then(Obstacle::cure).unwrap_or("lower --error");
            format!("an error of {asked:.2} % was asked for and may not be met: {light}; {cure}")
        }
    }
}

/// Whether emitted light is accounted for.
fn is_balanced(balance: &EnergyBalance) -> bool {
    balance.relative_imbalance().abs() <= IMBALANCE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_the_error_takes_four_times_the_vertices_that_were_added() {
        assert_eq!(vertices_asked_for(10_000, 2.0), 30_000);
        assert_eq!(vertices_asked_for(10_000, 1.0), 0);
    }

    #[test]
    fn an_imbalance_comes_with_the_cure_that_fits() {
        let met = imbalance(0.034, Some((0.05, true)), None);
        let words =
            "an error of 5.00 % was asked for and may not be met: 3.4 % of the emitted light is missing";
        assert_eq!(met, format!("{words}; lower --error"));
        let ended = imbalance(0.034, Some((0.05, true)), Some(Obstacle::MaxVertices));
        assert_eq!(ended, format!("{words}; raise --max-vertices"));
        let missed = imbalance(-0.2, Some((0.05, false)), None);
        assert_eq!(missed, "20.0 % of the emitted light is too much: the error may be larger than is said");
        assert!(imbalance(0.034, None, None).ends_with("lower --mesh-error"));
    }
}
