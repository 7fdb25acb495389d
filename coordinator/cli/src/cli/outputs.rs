//! The files that a command writes.

use std::io::{self, Write};
use std::path::Path;

use anyhow::Context;
use output::files::{self, AtomicWriteFile, FileError};

/// Files with their names in words; those that the user did not ask for are none.
type Named<'a> = [(&'static str, Option<&'a Path>)];

/// Checks that nothing is written over a file that is read, or over another output.
pub fn check_distinct(read: &Named, written: &Named) -> Result<(), FileError> {
    fn given<'a>(files: &Named<'a>) -> Vec<(&'static str, &'a Path)> {
        files.iter().filter_map(|(name, path)| Some((*name, (*path)?))).collect()
    }
    files::check_distinct(&given(read), &given(written))
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
