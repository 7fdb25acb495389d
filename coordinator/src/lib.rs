//! The coordinator: holds the scene and the energies, shoots, schedules rows on workers, writes the lit glTF.

pub mod bake;
pub mod cluster;
mod disjoint_sets;
pub mod export;
pub mod import;
pub mod lit;
pub mod mesh;
mod placement;
pub mod plain;
pub mod reference;
pub mod scene;
pub mod scheduler;
pub mod score;
pub mod solver;
pub mod study;
pub mod view_factors;
