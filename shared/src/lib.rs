//! What coordinator and workers have in common.
//!
//! | module | what lives there |
//! |---|---|
//! | [`geometry`] | planes and convex polygons |
//! | [`form_factor`] | form factors of a point or a polygon to a polygon, without occlusion |
//! | [`occluder`] | the surfaces that block light, behind a BVH |
//! | [`visibility`] | how much of a form factor the occluders leave |
//! | [`replica`] | the read-only data that a worker holds |
//! | [`row`] | rows of form factors: how they are asked for and how they travel |
//! | [`simd`] | wide vectors, chosen at run time |
//! | [`protocol`] | the generated messages of `radiosity.worker.v1` |

pub mod form_factor;
pub mod geometry;
pub mod occluder;
pub mod protocol;
pub mod replica;
pub mod row;
pub mod simd;
pub mod visibility;
