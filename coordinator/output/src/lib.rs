//! Output: lit files and pictures of them.
//!
//! In: a lit mesh and the scene that it belongs to, or a lit file. Out: lit glTF, PLY, PNG and EXR. It must not know workers, jobs or
//! how light was computed. Begin reading at [`export`](mod@export).
//!
//! | module | what lives there |
//! |---|---|
//! | [`export`](mod@export) | the input document with refined geometry and light, or PLY |
//! | [`render`] | pictures of lit files |

pub mod export;
pub mod render;
