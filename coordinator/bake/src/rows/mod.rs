//! The rows of a bake: form factors between shares and receivers, how they are made, and how light is solved for with them.
//!
//! | file | what it does |
//! |---|---|
//! | `source` | the trait of a row strategy |
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

use scene::Scene;

use crate::settings::{BakeSettings, RowStrategy};
pub use means::ShareValues;
pub use share_mesh::ShareMesh;
pub use shoot::FIRST_TOLERANCE;
pub use solution::Solution;
pub use source::{Cover, Gathered, Problem, Rows};
pub use vertices::COARSE;

/// Scenes with at least this many facets get hemisphere rows, unless a strategy was chosen.
const MANY_FACETS: usize = 5000;

/// The same of facets with smooth normals: they stand for curved surfaces, where many small occluders crowd each shaft.
const MANY_SMOOTH_FACETS: usize = 1000;

/// The row strategy for a scene.
pub fn row_source(scene: &Scene, settings: &BakeSettings) -> Box<dyn source::RowSource> {
    let gathers = match settings.rows {
        RowStrategy::Exact => false,
        RowStrategy::Gather => true,
        RowStrategy::Automatic => {
            let facets = || scene.front_facets();
            let smooth = facets().filter(|f| f.corners.iter().any(|corner| corner.normal != f.normal));
            facets().count() >= MANY_FACETS || smooth.count() >= MANY_SMOOTH_FACETS
        }
    };
    if gathers { Box::new(gather::GatherRows::default()) } else { Box::new(exact::ExactRows) }
}
