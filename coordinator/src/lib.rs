//! The coordinator: holds the scene and the energies, shoots, schedules rows on workers, writes the lit glTF.

pub mod import;
pub mod lit;
pub mod scene;
