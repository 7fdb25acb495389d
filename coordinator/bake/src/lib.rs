//! The bake: from a scene to a lit mesh.
//!
//! In: a [`scene::Scene`], [`BakeSettings`], and a [`RowService`] that computes rows of form factors. Out: a [`lit::LitMesh`] with
//! its error and energy balance. It must not know connections, files of the output, or jobs of a service. Begin reading at
//! [`bake()`], then `stages`.
//!
//! Each module may use those below it:
//!
//! | module | what lives there |
//! |---|---|
//! | `run` | [`bake()`] |
//! | `relight` | a finished bake with other light |
//! | [`occlusion()`] | ambient occlusion of a lit mesh |
//! | `output_mesh` | fewer vertices, no T-junctions |
//! | `stages` | the stages of a bake, in their order |
//! | `rows` | row strategies, exact or gather, and the solution with them |
//! | `refinement` | where the mesh needs more vertices |
//! | `jobs` | rows requested and received, progress |
//! | [`solver`] | shooting, sweeps, energy balance: pure |
//! | [`mesh`] | patches, vertices, shares |
//! | [`lit`] | the lit mesh |

mod channels;
mod context;
mod error;
mod error_budget;
mod jobs;
mod light_parts;
pub mod lit;
mod materials;
pub mod mesh;
mod observer;
mod occlusion;
mod output_mesh;
mod preview;
mod refinement;
mod relight;
mod rows;
mod run;
mod settings;
pub mod solver;
mod stages;
#[cfg(test)]
mod test_scenes;

pub use error::BakeError;
pub use error_budget::ErrorBudget;
pub use jobs::{RowService, ThreadTime};
pub use light_parts::{LightGroup, LightPart};
pub use observer::{Observer, Phase, Progress, RATED, TimeParts, Unobserved, time_left, time_of_rows_left};
pub use occlusion::occlusion;
pub use relight::{KeptLight, LightChange, NewLight, RelightError, RelightReport, Relit, relight};
pub use run::{Baked, bake, bake_with_points};
pub use settings::{BakeSettings, Quality, RowStrategy};
pub use stages::{AskedPoints, PointLight};
pub use stages::{BakeReport, Model, ShootingMesh, check_groups, listed, occluders};
