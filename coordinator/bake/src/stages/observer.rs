//! Who watches a bake: how far it is, what it knows by now, and whether it is still wanted.

use serde::Serialize;

use crate::lit::LitMesh;

/// What a bake is doing.
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
    /// Last sweeps and triangles.
    Settle,
    /// Light by groups of its sources.
    Groups,
}

impl Phase {
    /// All of them, in the order in which they come first.
    pub const ALL: [Self; 6] =
        [Self::Light, Self::Shoot, Self::Refine, Self::Measure, Self::Settle, Self::Groups];

    /// What it is called in a line of progress.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Light => "light",
            Self::Shoot => "shoot",
            Self::Refine => "refine",
            Self::Measure => "measure",
            Self::Settle => "settle",
            Self::Groups => "groups",
        }
    }
}

/// How far a bake has come.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// What it is doing.
    pub phase: Phase,
    /// Unshot flux over reflected flux.
    pub unshot: f64,
    /// Error of the present answer as the bake estimates it, relative L2 of the radiosity; none until it was measured, and none
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
}

/// Who watches a bake. It is asked and told in the thread of the bake, often: each call should return at once.
///
/// Nothing that an observer does changes the answer; it can only end the bake.
pub trait Observer {
    /// The bake has come so far: told whenever rows come and whenever a step begins.
    fn progress(&mut self, progress: &Progress);

    /// Whether the bake is not wanted any more. Asked whenever rows come or are waited for, ten times a second at least, but
    /// not within a step of the coordinator's own, which takes seconds only for millions of triangles.
    fn is_cancelled(&mut self) -> bool {
        false
    }

    /// Whether the present state is wanted: asked after the light, while the bake shoots, after each round of refinement and
    /// while it settles. To make it costs about what the triangles of the output do; nothing when it is not wanted.
    fn wants_present(&mut self) -> bool {
        false
    }

    /// Takes the present state, after it was wanted: a whole lit mesh of what is known by now, with [`LitMesh::unshot`].
    fn present(&mut self, lit: LitMesh) {
        drop(lit);
    }
}

/// Nobody watches.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unobserved;

impl Observer for Unobserved {
    fn progress(&mut self, _: &Progress) {}
}
