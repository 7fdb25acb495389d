//! The files that a scene is read from, against those that are written.

use std::path::Path;

use document::files_beside;
use output::export::{ExportError, files_of};
use scene::Scene;

/// Checks that nothing is written over the file of a scene, the buffers and images beside it, or another file that is read.
pub(crate) fn check_files(
    (scene, file): (&Scene, Option<&Path>),
    kept_light: Option<&Path>,
    output: &Path,
    written: &[(&'static str, Option<&Path>)],
) -> Result<(), ExportError> {
    let folder = file.map(|file| file.parent().unwrap_or(Path::new("")));
    let beside = folder.map(|folder| files_beside(&scene.source.root, folder)).unwrap_or_default();
    let mut read: Vec<(&str, &Path)> =
        beside.iter().map(|path| ("buffer or image of the scene", &**path)).collect();
    read.extend(file.map(|file| ("scene", file)));
    read.extend(kept_light.map(|kept| ("kept light", kept)));
    let outputs = files_of(output)?;
    let outputs = outputs.iter().map(|path| ("output", &**path));
    let others = written.iter().filter_map(|(name, path)| Some((*name, (*path)?)));
    Ok(files::check_distinct(&read, &outputs.chain(others).collect::<Vec<_>>())?)
}
