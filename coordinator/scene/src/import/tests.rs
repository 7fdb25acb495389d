//! Whole documents, from bytes to scene.

mod area_lights;
mod bad_input;
mod buffers;
mod facets;
mod files;
mod fuzz;
mod geometry;
mod joining;
mod lights;
mod materials;
mod numbers;
mod planes;
mod prepare;
mod scene_choice;
mod sealed;
mod textures;
mod weld;
