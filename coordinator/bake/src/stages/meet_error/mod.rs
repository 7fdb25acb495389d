//! Refining and measuring until the error is met.

mod better_settings;
mod explain;
mod judge;

use std::ops::ControlFlow;

use judge::is_balanced;

use super::measure::Measured;
use super::new_start::NewStart;
use super::refine::{Aim, UNSEEN_STEP};
use super::solved::Solved;
use crate::context::Context;
use crate::error::Result;
use crate::settings::BakeSettings;

/// What is left to the interpolation is aimed at with this margin.
const MARGIN: f64 = 0.9;

/// Part of what an asked error leaves to interpolation that refinement aims at first, where rows are exact: vertices cost least there, and pictures
/// show errors that the sum over all surfaces does not.
const PART_OF_ASKED: f64 = 0.4;

/// Part of the interpolation error that is aimed at, at least, before it is measured again: the finer mesh tells better what the
/// others leave to it, and vertices too many cannot be taken back.
const LONGEST_STEP: f64 = 0.6;

/// A round may add this times as many vertices as the error asks for, where it falls with the square root of those added: the
/// prediction of a noisy scene may never reach its limit.
const SPARE_VERTICES: f64 = 1.5;

/// Vertices that a round may add whatever the error.
const FREE_VERTICES: usize = 1000;

/// Vertices for each that is added for the sake of the shooters, at least. They are added where light changes most, and make a tenth
/// more leaves even where a quadrilateral takes five vertices for three leaves more: enough for the shooters to follow.
const VERTICES_PER_NEW: usize = 6;

/// Refining and measuring are repeated this often at most.
const MAX_ROUNDS: u32 = 12;

/// Most rounds for the sake of the balance alone: not every imbalance is one of interpolation.
const ROUNDS_FOR_BALANCE: u32 = 4;

/// Gather points are added this often at most.
const MOST_ADDITIONS: u32 = 3;

impl Solved {
    /// Refines and measures, until the asked error is met or limited by something else than interpolation. Breaks with settings
    /// for a new start where those should meet it.
    pub fn meet_error(self, cx: &mut Context) -> Result<ControlFlow<NewStart, Measured>> {
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
            if shooters.is_some() && measured.shooters_should_follow(cx.settings) {
                measured = measured.measure_shooters(cx)?;
                shooters = None;
            }
            measured = measured.follow_where_needed(cx)?;
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
                measured = measured.measure_shooters(cx)?.follow_where_needed(cx)?;
                better = measured.better_settings(cx, is_last);
            }
            if is_end(&measured, &better, cx) {
                return Ok(match better {
                    Some(settings) => {
                        // All but finer shooters is for less noise.
                        if settings.shooter_edge == cx.settings.shooter_edge {
                            cx.work.noise_at_restart = Some(measured.error.visibility);
                        }
                        ControlFlow::Break(NewStart { rows: measured.solved.rows, settings, mesh: None })
                    }
                    None => ControlFlow::Continue(measured),
                });
            }
            let of_mesh = measured.of_mesh();
            let limit = if measured.is_enough(cx.settings) {
                rounds_for_balance += 1;
                UNSEEN_STEP * aim.limit.min(of_mesh)
            } else {
                (MARGIN * measured.aim_for_mesh(cx.settings)).max(LONGEST_STEP * of_mesh)
            };
            let vertices = measured.solved.mesh.mesh.vertices.len();
            let mut asked = vertices_asked_for(vertices - first_vertices, of_mesh / limit);
            if measured.finer_mesh_helps_shooters(cx.settings) {
                asked = asked.max(vertices / VERTICES_PER_NEW);
            }
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

impl Measured {
    /// Lets the shooters follow the mesh where they should.
    fn follow_where_needed(self, cx: &mut Context) -> Result<Self> {
        if self.shooters_should_follow(cx.settings) { self.follow_mesh(cx) } else { Ok(self) }
    }
}

/// How many more vertices bring an error of `over` limits under its limit, where `added` have been added before: it falls with the square
/// root of their number.
fn vertices_asked_for(added: usize, over: f64) -> usize {
    ((over * over - 1.0).max(0.0) * added as f64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_the_error_takes_four_times_the_vertices_that_were_added() {
        assert_eq!(vertices_asked_for(10_000, 2.0), 30_000);
        assert_eq!(vertices_asked_for(10_000, 1.0), 0);
    }
}
