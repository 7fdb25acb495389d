//! Light probes: points in the space of a scene, and spherical harmonics of order 2 of the light that arrives there.
//!
//! In: a [`scene::Scene`] and a spacing, or points. Out: a [`Plan`] with receivers, before the bake, and [`Probes`] from the light
//! there, after it. It must not know how light is computed, or which files are written. Begin reading at [`plan()`].
//!
//! Each module may use those below it:
//!
//! | module | what lives there |
//! |---|---|
//! | `plan` | from a scene to receivers; [`Plan::probes`]: from their light to harmonics |
//! | `inside` | which points lie inside of walls |
//! | `grid` | points at even distances |
//! | `harmonics` | spherical harmonics, and the normals that they are fitted to |
//! | `error` | why there are no probes |

mod error;
mod grid;
mod harmonics;
mod inside;
mod plan;

pub use error::{MOST_PROBES, ProbeError};
pub use grid::Grid;
pub use harmonics::{Coefficients, irradiance};
pub use plan::{Places, Plan, PlanReport, Probes, plan};
