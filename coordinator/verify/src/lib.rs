//! Verification of bakes by independent means: an importer, a path tracer, scores and studies.
//!
//! In: scene files, lit files, references. Out: path-traced references, errors against them, tables and plots. It must not know the
//! bake, nor the bake's import, so that a fault of one cannot hide in the other; both only read files through [`document`]. Begin
//! reading at [`plain`], then [`reference`](mod@reference).
//!
//! | module | what lives there |
//! |---|---|
//! | [`plain`] | scenes as plain triangles |
//! | [`reference`](mod@reference) | the path tracer |
//! | [`score`](mod@score) | the error of a lit file |
//! | [`picture`] | the error that the eye sees |
//! | [`study`] | error over time, knob by knob |

pub mod picture;
pub mod plain;
pub mod reference;
pub mod score;
pub mod study;
