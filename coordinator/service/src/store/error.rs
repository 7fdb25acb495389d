//! Why a data folder cannot be opened.

use std::io;
use std::path::PathBuf;

use super::LAYOUT;

/// Why a data folder cannot be opened. Its files are left as they are.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The operating system refuses.
    #[error("data folder {} cannot be used: {error}; choose another --data", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The operating system's error.
        error: io::Error,
    },
    /// Another service uses it.
    #[error("data folder {} is in use by another service: stop that one, or choose another --data", path.display())]
    InUse {
        /// The folder.
        path: PathBuf,
    },
    /// One of its files cannot be one.
    #[error("{} is a folder, a pipe or a device, where a service keeps a file: remove it (`layout` must be put back), or choose another --data", path.display())]
    NoFile {
        /// What is in its place.
        path: PathBuf,
    },
    /// It has another layout.
    #[error(
        "data folder {} says {found:?} in its file `layout`, and this release knows {LAYOUT:?}: use the release that \
         wrote it, or choose another --data",
        path.display()
    )]
    Layout {
        /// The folder.
        path: PathBuf,
        /// Content of its `layout`.
        found: String,
    },
    /// It has files but no layout.
    #[error("data folder {} has files that are no service's: choose another --data", path.display())]
    Foreign {
        /// The folder.
        path: PathBuf,
    },
    /// One of its folders is gone.
    #[error(
        "data folder has lost {}, and the other folders depend on it: put it back, or make an empty one to go on \
         without; files that no job refers to are then set aside",
        path.display()
    )]
    Lost {
        /// The folder that is missing.
        path: PathBuf,
    },
    /// A record was written by a later release.
    #[error(
        "job record {} is of version {theirs}, this release reads up to {ours}: use the release that wrote it",
        path.display()
    )]
    RecordVersion {
        /// The file.
        path: PathBuf,
        /// Its version.
        theirs: u32,
        /// That of this release.
        ours: u32,
    },
}
