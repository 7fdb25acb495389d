//! The import report.

use serde::Serialize;

/// Parts of a file that the bake models or ignores. Each entry is a kind of thing with its number, such as `3 base colour textures`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct ImportReport {
    /// Parts that affect the light.
    pub modelled: Vec<String>,
    /// Parts that do not.
    pub ignored: Vec<String>,
}
