//! Files that no job refers to.
//!
//! After a crash these are uploads whose job was never accepted, and files of jobs that were deleted. But they may as well be files of
//! jobs whose records are missing: they are set aside, and it is for the operator to delete them.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::{PASSING, Store, files_of, sync_folder};
use crate::job::Record;

/// Where files are set aside.
const UNCLAIMED: &str = "unclaimed";

impl Store {
    /// Removes temporary files, and sets files aside that no record refers to, if all records are known. Returns their new places.
    pub(super) fn sweep(&self, records: &[Record]) -> io::Result<Vec<PathBuf>> {
        files_of(&self.root.join(PASSING))?.iter().try_for_each(fs::remove_file)?;
        let mut set_aside = vec![];
        if !self.all_known {
            return Ok(set_aside);
        }
        let mut named = BTreeSet::new();
        for record in records {
            named.insert(self.scene(record.scene));
            named.insert(self.checkpoint(record.id));
            named.insert(self.result(record));
            named.insert(self.light(record.light()));
        }
        for name in ["scenes", "results", "light", "checkpoints"] {
            let folder = self.root.join(name);
            for path in files_of(&folder)?.into_iter().filter(|path| !named.contains(path)) {
                let is_part = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
                if is_part {
                    // It was being written when the power failed.
                    fs::remove_file(&path)?;
                    continue;
                }
                match self.set_aside(name, &path) {
                    Ok(place) => set_aside.push(place),
                    // It may lie on another disk. It does no harm.
                    Err(error) => {
                        tracing::warn!(path = %path.display(), %error, "a file that no job refers to stays")
                    }
                }
            }
            sync_folder(&folder)?;
        }
        Ok(set_aside)
    }

    /// Moves a file of one of the folders to `unclaimed/`. Returns its new place.
    pub(super) fn set_aside(&self, of: &str, path: &Path) -> io::Result<PathBuf> {
        let folder = self.root.join(UNCLAIMED).join(of);
        fs::create_dir_all(&folder)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut place = folder.join(&name);
        // What was set aside before stays.
        for number in 2.. {
            if !place.exists() {
                break;
            }
            place = folder.join(format!("{name}.{number}"));
        }
        fs::rename(path, &place)?;
        sync_folder(&folder)?;
        Ok(place)
    }
}
