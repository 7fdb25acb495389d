//! The kernel: how much light travels between surfaces. Pure: no network, no threads, no clock.
//!
//! In: polygons, receivers and shooters. Out: rows of form factors, and pixels of pictures. It must not know meshes, energies,
//! workers or connections. Begin reading at [`row`] (requests and answers), then [`visibility`].
//!
//! | module | what lives there |
//! |---|---|
//! | [`geometry`] | planes, convex polygons and boxes |
//! | [`form_factor`] | form factors of a point or a polygon to a polygon, without occlusion |
//! | [`occluder`] | the surfaces that block light, in a BVH |
//! | [`hierarchy`] | items in a BVH, found along rays |
//! | [`hemisphere`] | the polygons that a receiver sees, by rays |
//! | [`visibility`] | the part of a form factor that the occluders leave |
//! | [`replica`] | the read-only data that a worker holds |
//! | [`row`] | rows of form factors: requests, answers, and their encoding |
//! | [`picture`] | pictures of lit scenes, in tiles |
//! | [`messages`] | the generated messages that replicas and rows travel as |
//! | [`simd`] | wide vectors, chosen at run time |
//! | [`disjoint_sets`] | items that are joined step by step |
//! | `triangles` | triangles in a tree whose nodes have eight children, along rays and segments |

pub mod disjoint_sets;
pub mod form_factor;
pub mod geometry;
pub mod hemisphere;
pub mod hierarchy;
pub mod messages;
pub mod occluder;
pub mod picture;
pub mod replica;
pub mod row;
pub mod simd;
pub mod triangles;
pub mod visibility;
