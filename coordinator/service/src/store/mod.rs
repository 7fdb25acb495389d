//! The data folder.
//!
//! | module | what lives there |
//! |---|---|
//! | `record` | a job as a file |
//! | `disk` | files and folders |
//! | `error` | why a folder cannot be opened |
//! | `check` | whether the files are as they were written |
//! | `reserve` | room for changes of jobs on a full disk |
//! | `upload` | a scene that is being uploaded |
//! | `sweep` | files that no job refers to |
//! | `room` | disk usage, and which jobs expire |
//!
//! ```text
//! DATA/layout            "halflight service data, layout 1"
//! DATA/lock              held by the one service that uses the folder
//! DATA/jobs/ID           a record for each job
//! DATA/scenes/SHA256     the files that were submitted, each once
//! DATA/results/ID.glb    lit files (or .ply)
//! DATA/light/ID          the light of each source, for relights
//! DATA/checkpoints/ID    finished rows of unfinished jobs
//! DATA/reserve           room for changes of jobs when the disk is full
//! DATA/passing/          temporary files: uploads in progress, previews
//! DATA/unclaimed/        files that no job refers to, and rows of jobs whose scene is gone
//! ```
//!
//! A file appears under its name when all of it is on disk, and a record is written last and removed first: whenever the power
//! fails, a record refers only to files that exist. Files that no record refers to are set aside at the start, never deleted: it may
//! be the records that are missing. File names are random bits and digests, never a client's text.

mod check;
mod disk;
mod error;
mod record;
mod reserve;
mod room;
mod sweep;
#[cfg(test)]
mod tests;
mod upload;

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use files::{LockedFile, is_irregular, read_regular};
use protocol::api::Format;

pub use check::{DataCheck, check};
pub(crate) use disk::{digest, remove_file};
use disk::{files_of, sync_folder};
pub use error::StoreError;
use reserve::RESERVE;
pub use room::{Room, expired};
pub use upload::Upload;

use super::job::{JobId, Record, SceneDigest};

/// Content of the file `layout`.
const LAYOUT: &str = "halflight service data, layout 1\n";

/// Folders that the service keeps its files in.
const FOLDERS: [&str; 6] = ["jobs", "scenes", "results", "light", "checkpoints", PASSING];

/// The folder of temporary files.
const PASSING: &str = "passing";

/// Folders whose loss costs nothing but time: backups have none of them.
const REPLACED: [&str; 2] = ["checkpoints", PASSING];

/// The data folder of one service.
#[derive(Debug)]
pub struct Store {
    root: PathBuf,
    /// Held while the folder is in use; a check and a job need none.
    _lock: Option<LockedFile>,
    /// Whether all records could be read: one that is damaged may refer to any scene and light.
    all_known: bool,
    /// Held while room is made or spent: whether the log says that there is none.
    lacks_room: Mutex<bool>,
}

/// An opened data folder and its contents.
#[derive(Debug)]
pub struct Opened {
    /// The folder.
    pub store: Store,
    /// Its jobs.
    pub records: Vec<Record>,
    /// Records that cannot be read, left in place.
    pub damaged: Vec<PathBuf>,
    /// What no record refers to, now in the folder for it.
    pub set_aside: Vec<PathBuf>,
}

impl Store {
    /// Opens or creates a data folder, and sets files aside that no record refers to.
    ///
    /// # Errors
    /// When it is in use, has another layout, lacks a folder, or cannot be read and written.
    pub fn open(root: &Path) -> Result<Opened, StoreError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |error| StoreError::Io { path, error }
        };
        fs::create_dir_all(root).map_err(failed(root))?;
        if !Self::is_laid_out(root)? {
            // A first start that was interrupted leaves empty folders.
            let is_ours = |entry: fs::DirEntry| {
                let name = entry.file_name();
                let name = name.to_str().unwrap_or_default();
                let is_empty = || files_of(&entry.path()).is_ok_and(|files| files.is_empty());
                name == "lock" || name.starts_with(".layout") || (FOLDERS.contains(&name) && is_empty())
            };
            let mut entries = fs::read_dir(root).map_err(failed(root))?;
            if entries.any(|entry| entry.map_or(true, |entry| !is_ours(entry))) {
                return Err(StoreError::Foreign { path: root.to_owned() });
            }
        }
        let layout = root.join("layout");
        let path = root.join("lock");
        let mut options = fs::OpenOptions::new();
        let options = options.read(true).write(true).create(true).truncate(false);
        let lock = options.open(&path).map_err(failed(&path))?;
        let lock = LockedFile::of(lock).map_err(failed(&path))?;
        let lock = lock.ok_or_else(|| StoreError::InUse { path: root.to_owned() })?;
        for folder in FOLDERS {
            let folder = root.join(folder);
            fs::create_dir_all(&folder).map_err(failed(&folder))?;
        }
        sync_folder(root).map_err(failed(root))?;
        // Last: with it, all folders are there.
        files::write(&layout, LAYOUT.as_bytes()).map_err(failed(&layout))?;
        let store =
            Self { root: root.to_owned(), _lock: Some(lock), all_known: false, lacks_room: Mutex::default() };
        store.read_all()
    }

    /// Whether a folder has the layout of this release, with all that belongs to it.
    fn is_laid_out(root: &Path) -> Result<bool, StoreError> {
        let files = ["layout", "lock", RESERVE].map(|name| root.join(name));
        if let Some(path) = files.into_iter().find(|path| is_irregular(path)) {
            return Err(StoreError::NoFile { path });
        }
        let layout = root.join("layout");
        let found = match fs::read_to_string(&layout) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
            read => read.map_err(|error| StoreError::Io { path: layout, error })?,
        };
        if found != LAYOUT {
            return Err(StoreError::Layout { path: root.to_owned(), found });
        }
        let needed = FOLDERS.iter().filter(|name| !REPLACED.contains(name));
        match needed.map(|name| root.join(name)).find(|folder| !folder.is_dir()) {
            Some(path) => Err(StoreError::Lost { path }),
            None => Ok(true),
        }
    }

    fn read_all(mut self) -> Result<Opened, StoreError> {
        let failed = |path: &Path, error| StoreError::Io { path: path.to_owned(), error };
        let folder = self.root.join("jobs");
        let (mut records, mut damaged) = (vec![], vec![]);
        for path in files_of(&folder).map_err(|error| failed(&folder, error))? {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            if name.starts_with('.') {
                // A record that was being written when the power failed.
                fs::remove_file(&path).map_err(|error| failed(&path, error))?;
                continue;
            }
            let Ok(id) = name.parse::<JobId>() else {
                damaged.push(path);
                continue;
            };
            let bytes = read_regular(&path).map_err(|error| failed(&path, error))?;
            match record::decode(id, &bytes) {
                Ok(record) => records.push(record),
                Err(record::RecordError::Version { theirs }) => {
                    return Err(StoreError::RecordVersion { path, theirs, ours: record::VERSION });
                }
                Err(record::RecordError::Damaged) => damaged.push(path),
            }
        }
        records.sort_by_key(|record| record.sequence);
        self.all_known = damaged.is_empty();
        let set_aside = self.sweep(&records).map_err(|error| failed(&self.root, error))?;
        self.reserve();
        Ok(Opened { store: self, records, damaged, set_aside })
    }

    /// Writes a job's record, synced to disk.
    ///
    /// # Errors
    /// The operating system's; the record is then unchanged.
    pub fn write(&self, record: &Record) -> io::Result<()> {
        files::write(&self.record(record.id), &record::encode(record))
    }

    /// Removes a job's record and files; its scene and light only if no other job uses them.
    ///
    /// # Errors
    /// The operating system's. Files that are left without a record are set aside at the next start.
    pub fn remove(&self, record: &Record, scene_is_used: bool, light_is_used: bool) -> io::Result<()> {
        remove_file(&self.record(record.id))?;
        sync_folder(&self.root.join("jobs"))?;
        remove_file(&self.result(record))?;
        remove_file(&self.checkpoint(record.id))?;
        if !light_is_used {
            self.remove_light(record.light())?;
        }
        if scene_is_used { Ok(()) } else { self.remove_scene(record.scene) }
    }

    /// Removes the rows of a job that has ended. Where its scene is gone, they are set aside: nothing is deleted because something
    /// else is missing, and `solve --checkpoint` can read them.
    ///
    /// # Errors
    /// The operating system's.
    pub fn end_checkpoint(&self, record: &Record) -> io::Result<()> {
        let rows = self.checkpoint(record.id);
        if self.scene(record.scene).exists() || !rows.exists() {
            return remove_file(&rows);
        }
        let place = self.set_aside("checkpoints", &rows)?;
        tracing::warn!(path = %place.display(), "set aside, since the scene of its job is gone");
        Ok(())
    }

    /// Removes a scene that no record refers to, if all records are known; else sets it aside.
    ///
    /// # Errors
    /// The operating system's.
    pub fn remove_scene(&self, scene: SceneDigest) -> io::Result<()> {
        self.remove_shared("scenes", &self.scene(scene))
    }

    /// Removes the light of a bake that no record refers to, if all records are known; else sets it aside.
    ///
    /// # Errors
    /// The operating system's.
    pub fn remove_light(&self, baked: JobId) -> io::Result<()> {
        self.remove_shared("light", &self.light(baked))
    }

    fn remove_shared(&self, folder: &str, path: &Path) -> io::Result<()> {
        if self.all_known || !path.exists() {
            return remove_file(path);
        }
        let place = self.set_aside(folder, path)?;
        tracing::warn!(path = %place.display(), "set aside, since a damaged record may refer to it");
        Ok(())
    }

    /// The store of a folder that a service has opened, for the process of a job.
    #[must_use]
    pub fn within(root: &Path) -> Self {
        Self { root: root.to_owned(), _lock: None, all_known: false, lacks_room: Mutex::default() }
    }

    /// The folder.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// A record as it is stored.
    #[must_use]
    pub fn encode(record: &Record) -> Vec<u8> {
        record::encode(record)
    }

    /// The record that these bytes are, if they are one.
    #[must_use]
    pub fn decode(job: JobId, bytes: &[u8]) -> Option<Record> {
        record::decode(job, bytes).ok()
    }

    /// Removes the files that the process of a job had begun to write when it was ended.
    pub fn remove_halves(&self, record: &Record) {
        for path in [self.result(record), self.light(record.id)] {
            let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else { continue };
            // As `AtomicWriteFile` calls them.
            let begin = format!(".{}.", name.display());
            for half in files_of(folder).unwrap_or_default() {
                let is_half = |name: &OsStr| name.as_encoded_bytes().starts_with(begin.as_bytes());
                if half.file_name().is_some_and(is_half) {
                    // On failure, the next start sets it aside.
                    let _ = remove_file(&half);
                }
            }
        }
    }

    /// Path of a job's record.
    fn record(&self, job: JobId) -> PathBuf {
        self.root.join("jobs").join(job.to_string())
    }

    /// Path of a scene.
    #[must_use]
    pub fn scene(&self, scene: SceneDigest) -> PathBuf {
        self.root.join("scenes").join(scene.to_string())
    }

    /// Path of a job's lit file.
    #[must_use]
    pub fn result(&self, record: &Record) -> PathBuf {
        let extension = match record.header.output.as_ref().map(protocol::api::OutputOptions::format) {
            Some(Format::Ply) => "ply",
            _ => "glb",
        };
        self.root.join("results").join(format!("{}.{extension}", record.id))
    }

    /// Path of the light that a baked job has kept.
    #[must_use]
    pub fn light(&self, baked: JobId) -> PathBuf {
        self.root.join("light").join(baked.to_string())
    }

    /// Path of a job's checkpoint.
    #[must_use]
    pub fn checkpoint(&self, job: JobId) -> PathBuf {
        self.root.join("checkpoints").join(job.to_string())
    }

    /// Returns a new path for a temporary file.
    ///
    /// # Errors
    /// When the system has no random bits.
    pub fn temporary(&self, extension: &str) -> io::Result<PathBuf> {
        let name = JobId::random().map_err(io::Error::other)?;
        Ok(self.root.join("passing").join(format!("{name}.{extension}")))
    }
}
