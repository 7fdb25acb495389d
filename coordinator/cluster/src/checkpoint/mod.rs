//! A bake that can be ended at any moment, and goes on where it was.
//!
//! | module | what lives there |
//! |---|---|
//! | `record` | one row as it stands in the file |
//! | `file` | opens a file, finds its records, cuts off what was not written to its end |
//! | `writer` | appends records in a thread of its own |
//! | `service` | answers from the file what is in it, and has the rest computed |
//!
//! A bake is determined by its rows: the same rows give the same bytes, whenever they come. So a checkpoint is a list of finished
//! rows, each under a digest of all that it depends on (scene, receivers, shooter, precision), and a bake that goes on is one that
//! begins anew and finds its first rows done. That costs the little that the coordinator itself computes, and there is no state that
//! could be saved in the wrong moment. Rows depend on geometry only: the checkpoint of a bake also serves one of the same scene with
//! other light.

mod file;
mod record;
mod service;
#[cfg(test)]
mod tests;
mod writer;

use std::path::{Path, PathBuf};
use std::{fs, io};

pub use service::Checkpointed;

/// Why a file cannot be used as a checkpoint. Nothing of it is lost.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file cannot be opened, read or created.
    #[error("checkpoint {} cannot be used: {error}; choose another --checkpoint", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },
    /// The file is something else.
    #[error("{} is not a checkpoint: choose another --checkpoint", path.display())]
    NotACheckpoint {
        /// The file.
        path: PathBuf,
    },
    /// Rows of another release may differ.
    #[error(
        "checkpoint {} was written by release {theirs}, this is {ours}: go on with that release, or remove the file",
        path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Release that wrote it.
        theirs: String,
        /// This release.
        ours: String,
    },
    /// Another process records to it.
    #[error("checkpoint {} is in use by another bake: choose another --checkpoint", path.display())]
    InUse {
        /// The file.
        path: PathBuf,
    },
}

/// What a checkpoint was good for.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CheckpointSummary {
    /// Rows that came from the file.
    pub rows_read: u64,
    /// Rows appended to it.
    pub rows_written: u64,
    /// Rows that were not recorded, because the disk did not keep up or the recording had ended.
    pub rows_dropped: u64,
    /// Length of the file.
    pub bytes: u64,
    /// Why the recording ended before the bake, where it did.
    pub stopped: Option<String>,
}

/// Removes the checkpoint of a bake that is done.
///
/// # Errors
/// When the system refuses.
pub fn remove(path: &Path) -> Result<(), CheckpointError> {
    fs::remove_file(path).map_err(|error| CheckpointError::Io { path: path.to_owned(), error })
}
