//! What coordinator and workers have in common.
//!
//! | module | what lives there |
//! |---|---|
//! | [`geometry`] | planes and convex polygons |
//! | [`form_factor`] | form factors of a point or a polygon to a polygon, without occlusion |
//! | [`occluder`] | the surfaces that block light, behind a BVH |
//! | [`hemisphere`] | what a receiver sees of all polygons, by rays |
//! | [`visibility`] | how much of a form factor the occluders leave |
//! | [`picture`] | pictures of lit scenes, in tiles |
//! | [`replica`] | the read-only data that a worker holds |
//! | [`row`] | rows of form factors: how they are asked for and how they travel |
//! | [`security`] | who may talk to whom: certificates, tokens, where plain text may go |
//! | [`server`] | what servers have in common: bounds of connections, and being told to stop |
//! | [`simd`] | wide vectors, chosen at run time |
//! | [`telemetry`] | logs, metrics and spans |
//! | [`api`] | the generated messages of `radiosity.v1`: what clients ask of a service |
//! | [`protocol`] | the generated messages of `radiosity.worker.v1` |

pub mod api;
pub mod form_factor;
pub mod geometry;
pub mod hemisphere;
pub mod occluder;
pub mod picture;
pub mod protocol;
pub mod replica;
pub mod row;
pub mod security;
pub mod server;
pub mod simd;
pub mod telemetry;
pub mod visibility;
