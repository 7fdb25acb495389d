//! Files beside a scene that it is read from, too.

use std::path::Path;

use document::files_beside;
use output::export::files_of;
use output::files;
use scene::Scene;

use crate::run::RunError;

/// Checks that nothing is written over a file that the scene is read from, beside its own.
pub(crate) fn check_files(
    scene: &Scene,
    folder: Option<&Path>,
    output: &Path,
    written: &[(&'static str, Option<&Path>)],
) -> Result<(), RunError> {
    let beside = folder.map(|folder| files_beside(&scene.source.root, folder)).unwrap_or_default();
    let read: Vec<(&str, &Path)> =
        beside.iter().map(|path| ("buffer or image of the scene", &**path)).collect();
    let outputs = files_of(output)?;
    let outputs = outputs.iter().map(|path| ("output", &**path));
    let others = written.iter().filter_map(|(name, path)| Some((*name, (*path)?)));
    Ok(files::check_distinct(&read, &outputs.chain(others).collect::<Vec<_>>())?)
}
