//! The coordinator: holds the scene and the energies, shoots, schedules rows on workers, writes the lit glTF.

pub mod appearance;
pub mod bake;
pub mod checkpoint;
pub mod cluster;
mod disjoint_sets;
pub mod export;
pub mod import;
pub mod lit;
pub mod mesh;
pub mod metrics;
mod placement;
pub mod plain;
pub mod reference;
pub mod render;
pub mod scene;
pub mod scheduler;
pub mod score;
pub mod service;
#[cfg(test)]
mod simulation;
pub mod solver;
pub mod study;
pub mod summary;
pub mod texture;
pub mod view_factors;
