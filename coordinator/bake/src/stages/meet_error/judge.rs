//! Parts of the measured error, and whether more vertices lessen it.

use super::Measured;
use crate::error_budget::without;
use crate::settings::BakeSettings;
use crate::solver::balance::EnergyBalance;

/// Part of the asked error from which on shooters follow the mesh where that costs no rows.
const FOLLOWED_PART: f64 = 0.3;

/// The interpolation must be left this part of the asked error at least: else it would have to pay for others.
const LEAST_REST: f64 = 0.4;

/// Part of the emitted flux that may be missing, or too much, where an error is said to be met. Samples may miss small bright places;
/// the balance does not.
const IMBALANCE: f64 = 0.02;

/// Part of the asked error from which on light between gather points gets more of them where the error is not met.
const MUCH_BETWEEN: f64 = 0.6;

impl Measured {
    /// Whether more vertices are of no use: the error is met, or something else limits it.
    pub(super) fn is_enough(&self, settings: &BakeSettings) -> bool {
        let is_met = self.error.receivers <= self.rest_for_receivers(settings) || self.is_predicted();
        let limited_by_others = self.others_take_all(settings)
            && self.of_mesh() <= self.aim_for_mesh(settings)
            && !self.finer_mesh_helps_shooters(settings);
        is_met || limited_by_others || self.obstacle.is_some()
    }

    /// Whether light between gather points is a large part of an error that is not met, and others leave something to it, or will once
    /// shooters follow a finer mesh.
    pub(super) fn is_limited_between(&self, settings: &BakeSettings) -> bool {
        let asked = settings.asked_error();
        let shooters = if self.shooters_may_follow() { 0.0 } else { self.error.shooters };
        self.is_missed(settings)
            && self.between > MUCH_BETWEEN * asked
            && self.error.with_shooters(shooters).without_receivers() < asked
    }

    /// Whether an error was asked for, and more is estimated.
    pub(super) fn is_missed(&self, settings: &BakeSettings) -> bool {
        settings.error.is_some_and(|asked| self.error.total > asked)
    }

    /// The error of interpolation on the mesh.
    pub(super) fn of_mesh(&self) -> f64 {
        without(self.error.receivers, self.between)
    }

    /// Whether shooters are the main reason why the error is missed, and follow a finer mesh.
    pub(super) fn finer_mesh_helps_shooters(&self, settings: &BakeSettings) -> bool {
        let others = self.error.with_shooters(0.0).without_receivers().hypot(self.between);
        self.is_missed(settings)
            && self.others_take_all(settings)
            && others < self.error.shooters.min(settings.asked_error())
            && self.shooters_may_follow()
    }

    /// Whether the mesh can be refined, and shooters follow it at no cost of rows.
    pub(super) fn shooters_may_follow(&self) -> bool {
        !self.solved.rows.source.leaves_cost_rows() && self.obstacle.is_none()
    }

    /// Whether the shooters take so much of the asked error that they should follow the mesh, and can. They are left as they are where
    /// the error is met: following traces the rays of all gather points again.
    pub(super) fn shooters_should_follow(&self, settings: &BakeSettings) -> bool {
        (settings.error.is_none() || self.is_missed(settings))
            && self.error.shooters > FOLLOWED_PART * settings.asked_error()
            && self.solved.can_follow_mesh()
    }

    /// Whether the other parts of the error leave next to nothing to interpolation on the mesh.
    pub(super) fn others_take_all(&self, settings: &BakeSettings) -> bool {
        settings.error.is_some_and(|asked| self.rest_for_mesh(settings) < LEAST_REST * asked)
    }

    /// The error of interpolation on the mesh that refinement aims at. Where others leave next to nothing, it may be as large as they
    /// are: vertices help until then.
    pub(super) fn aim_for_mesh(&self, settings: &BakeSettings) -> f64 {
        let rest = self.rest_for_mesh(settings);
        if self.others_take_all(settings) {
            rest.max(self.error.without_receivers().hypot(self.between))
        } else {
            rest
        }
    }

    /// What the other parts of the error leave to the interpolation.
    pub(super) fn rest_for_receivers(&self, settings: &BakeSettings) -> f64 {
        settings.error.map_or(settings.mesh_error, |asked| without(asked, self.error.without_receivers()))
    }

    /// What the other parts of the error leave to interpolation on the mesh.
    pub(super) fn rest_for_mesh(&self, settings: &BakeSettings) -> f64 {
        without(self.rest_for_receivers(settings), self.between)
    }

    /// Whether the error is predicted for want of samples.
    pub(super) fn is_predicted(&self) -> bool {
        self.solved.solution.samples.count() == 0
    }
}

/// Whether emitted light is accounted for.
pub(super) fn is_balanced(balance: &EnergyBalance) -> bool {
    balance.relative_imbalance().abs() <= IMBALANCE
}
