//! Whether the files of a data folder are as they were written.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

use bake::{KeptLight, RelightError};
use files::read_regular;
use protocol::api::State;

use super::disk::{digest, files_of};
use super::{Store, StoreError, record};
use crate::job::Record;

/// The result of a check.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct DataCheck {
    /// Number of files that were read.
    pub files: usize,
    /// Files that are gone, or not as they were written, with what that costs and the cure.
    pub damaged: Vec<(PathBuf, &'static str)>,
}

/// Reads the records, scenes, lit files and kept light of a data folder, and compares each with its digest. Changes nothing; a
/// service may use the folder meanwhile. `look` is told of each file before it is read.
///
/// # Errors
/// When the folder cannot be read.
pub fn check(root: &Path, mut look: impl FnMut(&Path)) -> Result<DataCheck, StoreError> {
    if !Store::is_laid_out(root)? {
        return Err(StoreError::Foreign { path: root.to_owned() });
    }
    let store = Store::within(root);
    let mut found = DataCheck::default();
    let mut known = BTreeSet::new();
    for record in store.check_records(&mut found, &mut look)? {
        for (path, is_whole, cure) in store.files_of_job(&record) {
            if !known.insert(path.clone()) {
                continue;
            }
            look(&path);
            found.files += 1;
            // It may have been deleted with its job since the record was read.
            if !is_whole(&path) && store.record(record.id).exists() {
                found.damaged.push((path, cure));
            }
        }
    }
    Ok(found)
}

/// A file, whether it is as it was written, and what to do where it is not.
type Check<'a> = (PathBuf, Box<dyn Fn(&Path) -> bool + 'a>, &'static str);

/// Whether a file is kept light as it was written, by whatever release.
fn is_light(path: &Path) -> bool {
    let read = read_regular(path).map(|bytes| KeptLight::from_bytes(&bytes));
    matches!(read, Ok(Ok(_) | Err(RelightError::Version { .. })))
}

impl Store {
    /// The records that are whole.
    fn check_records(
        &self,
        found: &mut DataCheck,
        look: &mut impl FnMut(&Path),
    ) -> Result<Vec<Record>, StoreError> {
        let failed = |path: &Path, error| StoreError::Io { path: path.to_owned(), error };
        let folder = self.root.join("jobs");
        let mut records = vec![];
        for path in files_of(&folder).map_err(|error| failed(&folder, error))? {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if name.starts_with('.') {
                // It is being written.
                continue;
            }
            look(&path);
            let bytes = match read_regular(&path) {
                // Its job was deleted.
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                read => read.ok(),
            };
            found.files += 1;
            let decoded = name.parse().ok().zip(bytes).map(|(id, bytes)| record::decode(id, &bytes));
            match decoded {
                Some(Ok(record)) => records.push(record),
                _ => found.damaged.push((path, "its job is not listed: take the record from a backup")),
            }
        }
        records.sort_by_key(|record| record.sequence);
        Ok(records)
    }

    /// The files that a job must have.
    fn files_of_job<'a>(&self, record: &'a Record) -> Vec<Check<'a>> {
        let mut files: Vec<Check> = vec![(
            self.scene(record.scene),
            Box::new(|path| digest(path).is_ok_and(|(_, found)| found == record.scene.0)),
            "jobs of this scene fail: submit the scene again, or take it from a backup",
        )];
        if let (State::Done, Some(outcome)) = (record.state, &record.outcome) {
            files.push((
                self.result(record),
                Box::new(|path| digest(path).is_ok_and(|(_, found)| found[..] == outcome.sha256[..])),
                "the lit file cannot be fetched: submit its scene again, or take it from a backup",
            ));
            if outcome.can_be_relit {
                files.push((
                    self.light(record.light()),
                    Box::new(is_light),
                    "the job cannot be relit: submit its scene again, or take the light from a backup",
                ));
            }
        }
        files
    }
}
