//! Why a file cannot be used as a checkpoint.

use std::path::{Path, PathBuf};
use std::{fs, io};

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

/// Removes the checkpoint of a finished bake.
///
/// # Errors
/// When the file cannot be removed.
pub fn remove(path: &Path) -> Result<(), CheckpointError> {
    fs::remove_file(path).map_err(|error| CheckpointError::Io { path: path.to_owned(), error })
}
