//! The stages of a bake, from scene to lit mesh. Each is a type that is made from the one before:
//!
//! | stage | step | what happens |
//! |---|---|---|
//! | [`Setup`](setup::Setup) | mesh | facets are divided into patches of shooting size; each vertex gets its share |
//! | [`Lit`](direct_light::Lit) | light | every light source's row: direct irradiance at the vertices |
//! | [`Solved`](solved::Solved) | shoot | shares shoot by falling unshot flux as their rows arrive; sweeps finish |
//! | [`Refined`](refine::Refined) | refine | patches are divided where interpolation is wrong; new vertices only receive |
//! | | final solve | shares take the mean radiosity of the refined mesh |
//! | [`Measured`](measure::Measured) | measure | the solution is compared with light gathered at random points |
//! | | back-face check | light that falls on the backs of one-sided surfaces is reported |
//! | | groups | the light of each group of sources is solved for separately; that of each source, where it is to be kept |
//! | | lightmap, probes | the solution is asked for the light of points that the caller names |
//!
//! Where an error is asked for, refining and measuring are repeated until it is met, or all of it with finer shooters or
//! more rays. Light at the refinement samples comes first: where that tells that more rays are needed, the stages start again at once.
//!
//! Shooters stay coarse while receivers are refined (substructuring): a share far away sends nearly the same light whether it
//! is one polygon or sixteen, but a shadow line on the receiving side needs its vertices.

mod asked;
mod back_face_check;
mod balance;
mod colours;
mod direct_light;
mod emitters;
mod even_light;
mod glow;
mod irradiance;
mod joint;
mod layers;
mod light;
mod light_source;
mod measure;
mod meet_error;
mod new_start;
pub mod occluders;
mod pictures;
mod pieces;
mod refine;
mod report;
mod samples_first;
mod setup;
mod shooting_mesh;
mod sides;
mod sky;
mod solved;
mod validation;

pub use asked::{AskedPoints, PointLight};
pub use irradiance::{Lights, Place, irradiance_at};
pub use layers::{PART_TOLERANCE, SKY, check_groups, listed, names_of};
pub use light_source::{LightSource, Origin};
pub use measure::Measured;
pub use new_start::NewStart;
pub use report::{BakeReport, Model};
pub use setup::Setup;
pub use shooting_mesh::ShootingMesh;
pub use solved::Solved;
