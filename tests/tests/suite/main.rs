//! The end-to-end tests: one program, because linking is what a test program costs most.
//!
//! | module | what is held against what |
//! |---|---|
//! | `form_factors` | factors of points and polygons against 60-digit values; no case of theirs is left out |
//! | `occlusion` | visible factors against 60-digit values |
//! | `area_lights` | area lights against formulas, emissive meshes and the path tracer |
//! | `lights` | spot and directional lights, by the row and in whole bakes, against formulas |
//! | `made_scenes` | the scenes of `tests::scenes`: files, references |
//! | `many_lamps` | small lamps that share rows against rows for each |
//! | `point_lights` | flux of point lights, as rows have it, against solid angles |
//! | `layout` | crates and modules against the rules of which may use which |
//! | `layers` | light by groups of its sources, direct and indirect, against the whole |
//! | `lightmaps` | texels against path-traced references and vertices, and the files that they come in |
//! | `asked_points` | light of many points beside the mesh against that of few |
//! | `probes` | light at points in space against the field of a disk and the solution's own irradiance |
//! | `ambient` | ambient occlusion where it is known |
//! | `relight` | scenes lit otherwise against bakes of the changed scenes |
//! | `leaks` | closed walls against light |
//! | `mesh` | the mesh against its promises: tiling, convexity, no cracks, balance |
//! | `output_mesh` | output meshes against T-junctions, triangles of the input and path-traced pictures |
//! | `furnace` | enclosures of constant radiosity against E / (1 - rho) |
//! | `enclosures` | a cube with one bright face and with a point light against their exact answers |
//! | `error_budget` | the stated error of a bake against the found one, knobs against its parts |
//! | `textures` | textures, vertex colours and alpha against plain scenes that say the same |
//! | `spheres` | spheres of many facets against the exact answers of spheres |
//! | `systems` | the solver alone against linear systems with known solutions |
//! | `public_files` | scenes like the Khronos feature tests, each held to what its test is about |
//! | `receiver_rows` | bakes with the rows of receivers against those with the rows of shooters, and exact answers |
//! | `pictures` | pictures against values from the lit mesh, and against the same pictures by other workers |
//! | `scenes` | whole bakes against path-traced references, and the files that come out |
//! | `reference` | references made here against those of an outside renderer |
//! | `study` | a study of a small room: its runs, its figures, its files |
//! | `size` | how a bake grows with its scene, and what is made again where rows are not kept, in counts |
//! | `determinism` | bakes against bakes by other workers, bit for bit |
//! | `dirty` | meshes as careless tools write them, against the same surfaces written with care |
//! | `nasty` | scenes that ask for trouble, made from seeds, against what must hold of every bake |
//! | `stability` | hard cases, and scenes told in several ways, against what is true of every bake |
//! | `security` | workers with certificates and tokens against those who have none or others, and against garbage |
//! | `service` | the long-running service against `solve`, crashes, wrong clients and what its protocol promises |
//! | `telemetry` | health, reflection and metrics against what was baked |
//! | `view_factors` | view factors of scenes against known values, a Monte Carlo of the test's own, and each other |
//! | `faults` | bakes while workers and the network fail against undisturbed ones, bit for bit |
//! | `bad_input` | the command line against wrong files, wrong addresses and lost workers |

mod ambient;
mod area_lights;
mod asked_points;
mod bad_input;
mod determinism;
mod dirty;
mod enclosures;
mod error_budget;
mod faults;
mod form_factors;
mod furnace;
mod glow;
mod layers;
mod layout;
mod leaks;
mod lightmaps;
mod lights;
mod made_scenes;
mod many_lamps;
mod mesh;
mod nasty;
mod occlusion;
mod output_mesh;
mod pictures;
mod point_lights;
mod probes;
mod promises;
mod public_files;
mod receiver_rows;
mod reference;
mod relight;
mod scenes;
mod security;
mod service;
mod shadow_lines;
mod size;
mod sky;
mod small_leaves;
mod spheres;
mod stability;
mod study;
mod systems;
mod telemetry;
mod textures;
mod view_factors;
