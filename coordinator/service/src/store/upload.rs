use std::fs::{self, File};
use std::io::{self, Write};
use std::path::PathBuf;

use sha2::{Digest, Sha256};

use super::{Store, remove_file, sync_folder};
use crate::job::SceneDigest;

/// A scene on its way in. Removed when it is dropped before it has its place.
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
    /// What the system says.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.hasher.update(bytes);
        self.received += bytes.len() as u64;
        self.file.write_all(bytes)
    }

    /// Bytes so far.
    #[must_use]
    pub fn received(&self) -> u64 {
        self.received
    }

    /// Digest of all that was written.
    #[must_use]
    pub fn digest(&self) -> SceneDigest {
        SceneDigest(self.hasher.clone().finalize().into())
    }
}

impl Drop for Upload {
    fn drop(&mut self) {
        // It may have moved to its place.
        let _ = remove_file(&self.path);
    }
}

impl Store {
    /// Begins to take in a scene.
    ///
    /// # Errors
    /// What the system says.
    pub fn begin_upload(&self) -> io::Result<Upload> {
        let path = self.temporary("upload")?;
        let file = File::create_new(&path)?;
        Ok(Upload { path, file, hasher: Sha256::new(), received: 0 })
    }

    /// Gives a scene that arrived its place, on the disk when this returns.
    ///
    /// # Errors
    /// What the system says.
    pub fn finish_upload(&self, upload: &Upload) -> io::Result<()> {
        let place = self.scene(upload.digest());
        // The same bytes may be there: a client has sent them before, or does so now.
        if !place.exists() {
            upload.file.sync_all()?;
            fs::rename(&upload.path, &place)?;
        }
        sync_folder(&self.root.join("scenes"))
    }
}
