//! The files that a command writes.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use document::files_beside_file;
use files::{AtomicWriteFile, FileError};

/// Buffers and images of a glTF, in words.
const BESIDE: &str = "buffer or image of the scene";

/// Files with their names in words; those that the user did not ask for are none.
type Named<'a> = [(&'static str, Option<&'a Path>)];

/// Checks that nothing is written over a file that is read, over the buffers and images beside it where it is a glTF, or over
/// another output.
pub fn check_distinct(read: &Named, written: &Named) -> Result<(), FileError> {
    fn given<'a>(files: &Named<'a>) -> Vec<(&'static str, &'a Path)> {
        files.iter().filter_map(|(name, path)| Some((*name, (*path)?))).collect()
    }
    let mut read = given(read);
    let beside: Vec<PathBuf> = read.iter().flat_map(|(_, path)| files_beside_file(path)).collect();
    read.extend(beside.iter().map(|path| (BESIDE, &**path)));
    files::check_distinct(&read, &given(written))
}

/// Checks that a file which is kept and extended is a regular one, if it is there.
pub fn check_regular(path: &Path, name: &str, option: &str) -> anyhow::Result<()> {
    anyhow::ensure!(
        !files::is_irregular(path),
        "{name} {} is no regular file: choose another {option}",
        path.display()
    );
    Ok(())
}

/// Checks that a report can be written.
pub fn check_report(path: &Path) -> anyhow::Result<()> {
    check_place(path, "report", "--report")
}

/// Checks that a file can be written that the user names with `option`.
pub fn check_place(path: &Path, name: &str, option: &str) -> anyhow::Result<()> {
    files::replace(path)
        .and_then(AtomicWriteFile::discard)
        .with_context(|| format!("{name} {} cannot be written: choose another {option}", path.display()))
}

/// Writes an output whole or not at all.
pub fn write_output(
    path: &Path,
    content: impl FnOnce(&mut (dyn Write + Send)) -> io::Result<()>,
) -> anyhow::Result<()> {
    files::write_with(path, content).with_context(|| format!("output {} cannot be written", path.display()))
}
