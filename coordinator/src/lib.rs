//! The coordinator: holds the scene and the energies, shoots, schedules rows on workers, writes the lit glTF.

pub mod bake;
pub mod cluster;
pub mod lit;
pub mod mesh;
pub mod scene;
pub mod scheduler;
pub mod solver;
