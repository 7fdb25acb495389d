//! Refinement: where the mesh needs more vertices, and what values fit best between them. Pure: it neither divides the mesh nor
//! asks for rows.
//!
//! | file | what it does |
//! |---|---|
//! | `plan` | what to divide next, or why to stop |
//! | `revealed` | errors that dividing patches revealed |
//! | `prediction` | predicts the interpolation error of each leaf |
//! | `cap` | how bright a place may be before its brightness counts no more |
//! | `samples` | light compared at random points |
//! | `draw` | draws such points |
//! | `fit` | vertex values with the least error between the vertices |

mod cap;
mod draw;
mod fit;
mod plan;
mod prediction;
mod revealed;
mod samples;

pub use cap::{Cap, parts_of_both};
pub use draw::{Draw, FIRST, MOST_DRAWN};
pub use fit::{best_fit, best_fit_of_part};
pub use plan::{Obstacle, Plan, Step, long_patches, room};
pub use prediction::{LEAST_WEIGHT, MeshError};
pub use revealed::RevealedErrors;
pub use samples::SamplePoints;
