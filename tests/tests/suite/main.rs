//! The end-to-end tests: one program, because linking is what a test program costs most.
//!
//! | module | what is held against what |
//! |---|---|
//! | `form_factors` | factors of points and polygons against 60-digit values; no case of theirs is left out |
//! | `occlusion` | visible factors against 60-digit values |
//! | `point_lights` | flux of point lights, as rows have it, against solid angles |
//! | `leaks` | closed walls against light |
//! | `mesh` | the mesh against its promises: tiling, convexity, no cracks, balance |
//! | `furnace` | enclosures of constant radiosity against E / (1 - rho) |
//! | `enclosures` | a cube with one bright face and with a point light against their exact answers |
//! | `error_budget` | the stated error of a bake against the found one, knobs against its parts |
//! | `spheres` | spheres of many facets against the exact answers of spheres |
//! | `systems` | the solver alone against linear systems with known solutions |
//! | `scenes` | whole bakes against path-traced references, and the files that come out |
//! | `reference` | references made here against those of an outside renderer |
//! | `study` | a study of a small room: its runs, its figures, its files |
//! | `size` | how a bake grows with its scene, and what is made again where rows are not kept, in counts |
//! | `determinism` | bakes against bakes by other workers, bit for bit |
//! | `stability` | hard cases, and scenes told in several ways, against what is true of every bake |
//! | `view_factors` | view factors of scenes against known values, a Monte Carlo of the test's own, and each other |
//! | `bad_input` | the command line against wrong files, wrong addresses and lost workers |

mod bad_input;
mod determinism;
mod enclosures;
mod error_budget;
mod form_factors;
mod furnace;
mod leaks;
mod mesh;
mod occlusion;
mod point_lights;
mod reference;
mod scenes;
mod size;
mod spheres;
mod stability;
mod study;
mod systems;
mod view_factors;
