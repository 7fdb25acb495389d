//! Whole documents, from bytes to scene.

mod facets;
mod files;
