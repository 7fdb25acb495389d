//! The rows of a bake: form factors between shares and receivers, how they are made, and how light is solved for with them.
//!
//! | file | what it does |
//! |---|---|
//! | `source` | the trait of a row strategy |
//! | `cost` | what the strategies cost |
//! | `exact` | exact shooter rows, solved for by shooting and sweeps |
//! | `factors` | exact rows as factors between shares, and the sweeps with them |
//! | `shoot` | shooting as rows arrive |
//! | `gather/` | hemisphere rows of gather points, solved for by passes |
//! | `table` | rows kept, or made again |
//! | `vertices` | the vertices as sets of receivers |
//! | `solution` | radiosity, irradiance and what is missing |
//! | `means` | which irradiance a share reflects |
//! | `weights` | how its vertices count in that |
//! | `share_mesh` | the mesh and its shares |
//!
//! A new strategy is a new file that implements `RowSource`, and an arm of [`row_source`].

mod cost;
mod exact;
mod factors;
mod gather;
mod means;
mod share_mesh;
mod shoot;
mod solution;
mod source;
mod table;
mod vertices;
mod weights;

use crate::settings::RowStrategy;

pub use cost::{exact_rows_cost_less, most_vertices_of_exact_rows};
pub use exact::ExactRows;
pub use gather::GatherRows;
pub use means::ShareValues;
pub use share_mesh::ShareMesh;
pub use shoot::FIRST_TOLERANCE;
pub use solution::Solution;
pub use source::{Cover, Gathered, Problem, RowSource, Rows, leaving};
pub use vertices::COARSE;

/// The rows of a strategy, where it is not to be chosen.
pub fn row_source(strategy: RowStrategy) -> Option<Box<dyn RowSource>> {
    match strategy {
        RowStrategy::Automatic => None,
        RowStrategy::Exact => Some(Box::new(ExactRows)),
        RowStrategy::Gather => Some(Box::new(GatherRows::default())),
    }
}
