//! The bake: from a scene to a lit mesh.
//!
//! In: a [`scene::Scene`], [`BakeSettings`], and a [`RowService`] that computes rows of form factors. Out: a [`lit::LitMesh`] with the
//! figures of its error and energy. It must not know connections, files of the output, or jobs of a service. Begin reading at
//! [`bake()`], then [`stages`].
//!
//! | module | what lives there |
//! |---|---|
//! | [`stages`] | the steps of a bake, in their order |
//! | [`mesh`] | patches, vertices, shares |
//! | [`solver`] | shooting, sweeps, refinement, fit, energy balance: pure |
//! | [`lit`] | the lit mesh |

mod disjoint_sets;
pub mod lit;
pub mod mesh;
pub mod solver;
pub mod stages;

pub use stages::{
    BakeError, BakeReport, BakeSettings, Baked, ErrorBudget, KeptLight, LightChange, LightGroup, LightPart,
    Model, NewLight, Observer, Phase, Progress, RelightError, RelightReport, Relit, RowService, RowStrategy,
    Unobserved, bake, check_groups, listed, occluders, relight,
};
