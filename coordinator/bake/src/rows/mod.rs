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
//! | `complete` | light at all vertices from the radiosity of the shares |
//! | `vertices` | the vertices as sets of receivers |
//! | `problem` | what is to be solved |
//! | `solution` | radiosity, irradiance and what is missing |
//! | `local_radiosity` | how radiosity differs within shares |
//! | `near` | light of shares that are near, part by part |
//! | `means` | which irradiance a share reflects |
//! | `weights` | how its vertices count in that |
//! | `share_mesh` | the mesh and its shares |
//!
//! A new strategy is a new file that implements `RowSource`, and an arm of [`row_source`].

mod complete;
mod cost;
mod exact;
mod factors;
mod gather;
mod local_radiosity;
mod means;
mod near;
mod problem;
mod share_mesh;
mod shoot;
mod solution;
mod source;
mod table;
mod vertices;
mod weights;

use crate::settings::RowStrategy;

pub use complete::VertexLight;
pub use cost::{exact_rows_cost_less, most_vertices_of_exact_rows};
pub use exact::ExactRows;
pub use gather::GatherRows;
pub use local_radiosity::{LocalRadiosity, Radiosity};
pub use means::ShareValues;
pub use problem::Problem;
pub use share_mesh::ShareMesh;
pub use shoot::FIRST_TOLERANCE;
pub use solution::Solution;
pub use source::{Cover, Gathered, RowSource, Rows, leaving};
pub use vertices::COARSE;

/// The rows of a strategy, where it is not to be chosen.
pub fn row_source(strategy: RowStrategy) -> Option<Box<dyn RowSource>> {
    match strategy {
        RowStrategy::Automatic => None,
        RowStrategy::Exact => Some(Box::new(ExactRows)),
        RowStrategy::Gather => Some(Box::new(GatherRows::default())),
    }
}
