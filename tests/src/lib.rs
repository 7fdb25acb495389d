//! What the end-to-end tests share.
//!
//! | module | what lives there |
//! |---|---|
//! | [`cases`] | the cases of `references/form_factors.json` |
//! | [`builder`] | small scenes, as the bytes of a GLB |
//! | [`painting`] | textures and vertex colours for their parts |
//! | [`shapes`] | polygons to build them from |
//! | [`building`] | buildings of any number of rooms |
//! | [`city`] | a city of boxes, of as many facets as asked for |
//! | [`baking`] | such a scene baked, and figures of the result |
//! | [`measured`] | the three scenes baked and scored |
//! | [`scenes`] | a furnished room, a house and a Cornell box with textures, as they stand in `tests/scenes` |
//! | [`rooms_only`] | rows of a building whose rooms do not see each other: what a bake costs beside visibility |
//! | [`dirty`] | a furnished room as careless tools write it |
//! | [`nasty`] | scenes that ask for trouble, made from a seed, and what must hold of their bakes |
//! | [`numbers`] | random numbers that are the same everywhere |
//! | [`certificates`] | certificates of an authority of the test's own |
//! | [`programs`] | the binaries of the workspace as processes |
//! | [`scene_command`] | a command that reads a scene and writes a file |
//! | [`service`] | a coordinator that serves clients, as a process |

pub mod baking;
pub mod builder;
pub mod building;
pub mod cases;
pub mod certificates;
pub mod city;
pub mod dirty;
pub mod measured;
pub mod nasty;
pub mod numbers;
pub mod painting;
pub mod programs;
pub mod rooms_only;
pub mod scene_command;
pub mod scenes;
pub mod service;
pub mod shapes;

use std::path::PathBuf;

/// A file of this crate, such as `scenes/cornell.glb`.
#[must_use]
pub fn data(relative: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(relative)
}
