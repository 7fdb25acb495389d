//! Checkpoints: a bake that is interrupted at any moment goes on where it was.
//!
//! | module | contents |
//! |---|---|
//! | `record` | the encoding of one row |
//! | `file` | opens a file, finds its records, cuts off an incomplete one |
//! | `writer` | appends records in a thread of its own |
//! | `service` | answers from the file, and has the other rows computed |
//!
//! Rows determine a bake: the same rows give the same bytes, in any order. So a checkpoint is a list of finished rows, each under a
//! digest of all that it depends on (scene, receivers, shooter, precision). A resumed bake starts again and finds its first rows done,
//! which costs only the coordinator's own computing and needs no other state. Rows depend on geometry only: a checkpoint also serves
//! the same scene with other lights.

mod file;
mod record;
mod service;
#[cfg(test)]
mod tests;
mod writer;

use std::path::{Path, PathBuf};
use std::{fs, io};

pub use service::Checkpointed;

/// Why a file cannot be used as a checkpoint. The file is left as it was.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file cannot be opened, read or created.
    #[error("checkpoint {} cannot be used: {error}; choose another --checkpoint", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        error: io::Error,
    },
    /// The file is not a checkpoint.
    #[error("{} is not a checkpoint: choose another --checkpoint", path.display())]
    NotACheckpoint {
        /// The file.
        path: PathBuf,
    },
    /// Rows of another release or row version may have other bits.
    #[error(
        "checkpoint {} was written by release {theirs}, this is {ours}: go on with that release, or remove the file",
        path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Release and row version that wrote it.
        theirs: String,
        /// This release and its row version.
        ours: String,
    },
    /// Another process uses it.
    #[error("checkpoint {} is in use by another bake: choose another --checkpoint", path.display())]
    InUse {
        /// The file.
        path: PathBuf,
    },
}

/// Use of a checkpoint by a bake.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CheckpointSummary {
    /// Rows read from the file.
    pub rows_read: u64,
    /// Rows appended to it.
    pub rows_written: u64,
    /// Rows not recorded, because the disk did not keep up or recording had stopped.
    pub rows_dropped: u64,
    /// Length of the file.
    pub bytes: u64,
    /// Why recording stopped before the end of the bake, if it did.
    pub stopped: Option<String>,
}

/// Removes the checkpoint of a finished bake.
///
/// # Errors
/// When the system refuses.
pub fn remove(path: &Path) -> Result<(), CheckpointError> {
    fs::remove_file(path).map_err(|error| CheckpointError::Io { path: path.to_owned(), error })
}
