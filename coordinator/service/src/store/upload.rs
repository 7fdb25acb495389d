use std::fs::{self, File};
use std::io::{self, Write};
use std::path::PathBuf;

use sha2::{Digest, Sha256};

use super::{Store, digest, remove_file, sync_folder};
use crate::job::SceneDigest;

/// A scene that is being uploaded; its file is removed if it is dropped unfinished.
#[derive(Debug)]
pub struct Upload {
    path: PathBuf,
    file: File,
    hasher: Sha256,
    received: u64,
}

impl Upload {
    /// Appends bytes.
    ///
    /// # Errors
    /// The operating system's.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.hasher.update(bytes);
        self.received += bytes.len() as u64;
        self.file.write_all(bytes)
    }

    /// Number of bytes so far.
    #[must_use]
    pub fn received(&self) -> u64 {
        self.received
    }

    /// Digest of the bytes so far.
    #[must_use]
    pub fn digest(&self) -> SceneDigest {
        SceneDigest(self.hasher.clone().finalize().into())
    }
}

impl Drop for Upload {
    fn drop(&mut self) {
        // A finished one has moved.
        let _ = remove_file(&self.path);
    }
}

impl Store {
    /// Whether a scene is there as it was submitted: a disk may lose it, change it, or be unable to read it.
    #[must_use]
    pub fn has_scene(&self, scene: SceneDigest) -> bool {
        digest(&self.scene(scene)).is_ok_and(|(_, found)| found == scene.0)
    }

    /// Begins an upload.
    ///
    /// # Errors
    /// The operating system's.
    pub fn begin_upload(&self) -> io::Result<Upload> {
        let path = self.temporary("upload")?;
        let file = File::create_new(&path)?;
        Ok(Upload { path, file, hasher: Sha256::new(), received: 0 })
    }

    /// Moves an uploaded scene to its path, synced to disk.
    ///
    /// # Errors
    /// The operating system's.
    pub fn finish_upload(&self, upload: &Upload) -> io::Result<()> {
        // The same bytes may exist: a client has sent them before, or is doing so.
        if !self.has_scene(upload.digest()) {
            upload.file.sync_all()?;
            fs::rename(&upload.path, self.scene(upload.digest()))?;
        }
        sync_folder(&self.root.join("scenes"))
    }
}
