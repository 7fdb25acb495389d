//! Observers of a bake: progress, previews, cancellation.

use std::time::Duration;

use serde::Serialize;

use crate::lit::LitMesh;

/// A phase of a bake.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Phase {
    /// Rows of the light sources.
    Light,
    /// Shooting.
    Shoot,
    /// Refining the mesh.
    Refine,
    /// Measuring the error.
    Measure,
    /// Solving again on the refined mesh.
    FinalSolve,
    /// Light by groups of its sources.
    Groups,
    /// Light of the texels of a lightmap.
    Lightmap,
    /// Light of probes.
    Probes,
    /// The mesh of the output.
    ExportMesh,
}

impl Phase {
    /// All phases, in the order in which they first begin.
    pub const ALL: [Self; 9] = [
        Self::Light,
        Self::Shoot,
        Self::Refine,
        Self::Measure,
        Self::FinalSolve,
        Self::Groups,
        Self::Lightmap,
        Self::Probes,
        Self::ExportMesh,
    ];

    /// Its name in metrics.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Light => "light",
            Self::Shoot => "shoot",
            Self::Refine => "refine",
            Self::Measure => "measure",
            Self::FinalSolve => "final solve",
            Self::Groups => "groups",
            Self::Lightmap => "lightmap",
            Self::Probes => "probes",
            Self::ExportMesh => "export mesh",
        }
    }
}

/// Progress of a bake.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// The present phase.
    pub phase: Phase,
    /// Unshot flux over reflected flux.
    pub unshot: f64,
    /// Estimated error of the present solution, relative L2 of the radiosity; none until it was measured, and none
    /// again while the bake begins anew with other settings.
    pub error: Option<f64>,
    /// Rows finished.
    pub rows: u64,
    /// Rows known to be needed, so far.
    pub rows_needed: u64,
    /// Rays cast.
    pub rays: u64,
    /// Vertices of the mesh.
    pub vertices: usize,
    /// How the wall time divides so far.
    pub time: TimeParts,
}

/// Rows that have come in less time tell no rate.
pub const RATED: Duration = Duration::from_millis(500);

/// The time that the rest will take, where what is done took `elapsed`; none before something is done.
#[must_use]
pub fn time_left(elapsed: Duration, done: u64, all: u64) -> Option<Duration> {
    let rest = all.checked_sub(done).filter(|_| done > 0)?;
    Duration::try_from_secs_f64(elapsed.as_secs_f64() * rest as f64 / done as f64).ok()
}

/// The same for the rows of a bake. While none are waited for something else is done, of which nobody knows how long it takes.
#[must_use]
pub fn time_of_rows_left(elapsed: Duration, rows: u64, needed: u64) -> Option<Duration> {
    time_left(elapsed, rows, needed).filter(|_| elapsed >= RATED && rows < needed)
}

/// Parts of the wall time of a bake, in seconds. While some threads of the workers compute and others do not, each part gets its
/// share: with one thread of four busy, a quarter of the time is [`Self::rows`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct TimeParts {
    /// Threads of workers computed rows of this bake. Over the wall time, this is how well the workers were used.
    pub rows: f64,
    /// They computed for other bakes, or what another worker had computed before.
    pub other_rows: f64,
    /// They had nothing to compute while jobs and rows were on their way, and replicas loaded.
    pub network: f64,
    /// They had nothing to compute while the bake waited for rows of others.
    pub waiting: f64,
    /// They had nothing to compute while the coordinator did its own arithmetic.
    pub own: f64,
}

impl TimeParts {
    /// The wall time.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.rows + self.other_rows + self.network + self.waiting + self.own
    }
}

/// An observer of a bake. It is called in the thread of the bake, often: each call should return at once.
///
/// An observer does not affect the result; it can only cancel the bake.
pub trait Observer {
    /// Takes the progress, whenever rows come and whenever a step begins.
    fn progress(&mut self, progress: &Progress);

    /// Returns true to cancel the bake. Asked whenever rows come or are waited for, ten times a second at least, but
    /// not within a step of the coordinator's own, which takes seconds only for millions of triangles.
    fn is_cancelled(&mut self) -> bool {
        false
    }

    /// Returns true to get a preview: asked after the light, while the bake shoots, after each round of refinement and
    /// during the final solve. It costs about what the triangles of the output do; nothing when it is not wanted.
    fn wants_preview(&mut self) -> bool {
        false
    }

    /// Takes a preview, after one was wanted: a whole lit mesh of the light so far, with [`LitMesh::unshot`].
    fn preview(&mut self, lit: LitMesh) {
        drop(lit);
    }
}

/// No observer.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unobserved;

impl Observer for Unobserved {
    fn progress(&mut self, _: &Progress) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_is_left_while_rows_are_waited_for() {
        assert_eq!(time_of_rows_left(RATED * 2, 10, 30), Some(RATED * 4));
        for (elapsed, rows, needed) in [(RATED / 2, 10, 30), (RATED, 0, 30), (RATED, 30, 30), (RATED, 0, 0)] {
            assert_eq!(
                time_of_rows_left(elapsed, rows, needed),
                None,
                "{rows} of {needed} after {elapsed:?}"
            );
        }
    }
}
