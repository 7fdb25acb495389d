//! The import report: what of a file counts in the bake, and what is ignored.

use serde::Serialize;

/// What of a file counts in the bake, and what is passed over: one entry for each kind of thing, with its number, such as `3 base
/// colour textures`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Account {
    /// What counts.
    pub modelled: Vec<String>,
    /// What does not.
    pub ignored: Vec<String>,
}
