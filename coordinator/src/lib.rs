//! The coordinator: holds the scene and the energies, shoots, schedules rows on workers, writes the lit glTF.

pub mod export;
pub mod lit;
mod placement;
pub mod scene;
pub mod score;
