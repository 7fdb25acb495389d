//! What the end-to-end tests share: where the scenes and references lie, and the cases of `form_factors.json`.

pub mod cases;

use std::path::PathBuf;

/// A file of this crate, such as `scenes/cornell.glb`.
#[must_use]
pub fn data(relative: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(relative)
}
