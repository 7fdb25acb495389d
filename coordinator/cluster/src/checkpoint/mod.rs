//! Checkpoints: a bake that is interrupted at any moment goes on where it was.
//!
//! | module | contents |
//! |---|---|
//! | `error` | errors, and the removal of a checkpoint |
//! | `record` | the encoding of one row |
//! | `file` | opens a file, finds its records, cuts off an incomplete one |
//! | `writer` | appends records in a thread of its own |
//! | `service` | answers from the file, and has the other rows computed |
//!
//! Rows determine a bake: the same rows give the same bytes, in any order. So a checkpoint is a list of finished rows, each under a
//! digest of all that it depends on (scene, receivers, shooter, precision). A resumed bake starts again and finds its first rows done,
//! which costs only the coordinator's own computing and needs no other state. Rows depend on geometry only: a checkpoint also serves
//! the same scene with other lights.

mod error;
mod file;
mod record;
mod service;
#[cfg(test)]
mod tests;
mod writer;

pub use error::{CheckpointError, remove};
pub use service::{CheckpointSummary, Checkpointed, OpenCheckpoint};
