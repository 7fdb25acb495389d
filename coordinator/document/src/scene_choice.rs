//! The choice of a document's scene.

use gltf::json::{Index, Root};

use super::error::ImportProblem;

/// Most scenes that a message lists.
const SHOWN_SCENES: usize = 20;

/// Makes the chosen scene the document's default, for all who read it afterwards. Other scenes stay in the document.
///
/// `wanted` is a name or an index from 0; names go first. `None` changes nothing.
///
/// # Errors
/// When no scene, or more than one, has the name.
pub(crate) fn choose(root: &mut Root, wanted: Option<&str>) -> Result<(), ImportProblem> {
    let Some(wanted) = wanted else { return Ok(()) };
    let mut called =
        (0..root.scenes.len()).filter(|&index| root.scenes[index].name.as_deref() == Some(wanted));
    let index = match (called.next(), called.next()) {
        (Some(index), None) => Some(index),
        (Some(_), Some(_)) => {
            let (wanted, scenes) = (wanted.to_owned(), list(root));
            return Err(ImportProblem::AmbiguousScene { wanted, scenes });
        }
        (None, _) => wanted.parse().ok().filter(|&index: &usize| index < root.scenes.len()),
    };
    let missing = || ImportProblem::NoSuchScene { wanted: wanted.to_owned(), scenes: list(root) };
    root.scene = Some(Index::new(index.ok_or_else(missing)? as u32));
    Ok(())
}

/// `0 "Hall", 1 "Garden" and 2`.
fn list(root: &Root) -> String {
    let names = root.scenes.iter().enumerate().map(|(index, scene)| match &scene.name {
        Some(name) => format!("{index} \"{name}\""),
        None => index.to_string(),
    });
    let mut shown: Vec<String> = names.take(SHOWN_SCENES).collect();
    match root.scenes.len().saturating_sub(shown.len()) {
        0 => {}
        further => shown.push(format!("{further} more")),
    }
    match shown.split_last() {
        None => "none at all".to_owned(),
        Some((only, [])) => only.clone(),
        Some((last, others)) => format!("{} and {last}", others.join(", ")),
    }
}
