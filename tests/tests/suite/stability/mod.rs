//! Hard cases, and scenes told in several ways. Every bake goes through [`checked`], which holds it to what is true of all bakes.
//!
//! | hard case | where |
//! |---|---|
//! | vertices on a neighbour's plane, edge, corner | `hard_cases::box_in_the_corner_of_a_room`, `form_factors::limits_at_edges_and_corners`, `furnace::cube` |
//! | nearly touching surfaces | `hard_cases::box_nearly_touching_the_floor`, `furnace::thin_slab` |
//! | sizes 1:1000 apart | `hard_cases::cubes_a_thousandth_of_the_room` |
//! | tiny, far, sliver, needle, grazing polygons | `hard_cases::{needle_through_the_room, floor_of_slivers}`, `form_factors` (cases of group `hard`), coordinator: `import` (`slivers_keep_their_area_and_normal`) |
//! | walls of thickness 0 and 2^-10 | `hard_cases::{wall_without_thickness, thin_walls, wall_that_passes_through_the_room}`, `leaks` |
//! | concave polygons | `furnace::prism_over_an_l`, coordinator: `import` (`concave_outlines_are_cut_into_convex_facets`) |
//! | interpenetrating solids | `hard_cases::interpenetrating_solids` |
//! | flipped normals | `flipped` |
//! | collinear and duplicate triangles, duplicate vertices | `hard_cases::what_import_drops_changes_nothing`, coordinator: `import` |
//! | T-vertices | `metamorphic::polygons_in_pieces`, `mesh`, `leaks` |
//! | reflectance .99, .999 | `hard_cases::nearly_white_rooms`, `furnace` |
//! | tiny bright lamps | `hard_cases::tiny_bright_lamp` |
//! | offsets of 1e6, scales of 1e-4 | `metamorphic::{far_from_the_origin, small_scenes}` |
//! | smoothed vertices over creases | `hard_cases::smoothed_over_creases` |
//! | non-manifold edges | `hard_cases::non_manifold_edges` |
//! | emissions 1e12 apart | `hard_cases::{channels_of_a_lamp_far_apart, closed_rooms_far_apart_in_brightness}` |
//! | coplanar layers, stacks with gaps, nested shells | `layers`, coordinator: `import` (`layers`) |
//! | open scenes | `hard_cases::open_scene` |
//! | permuted, mirrored, rotated, split, scaled by powers of two, emitter and receiver swapped | `metamorphic` |
//! | random polygons, random scenes | `random` |

mod checked;
mod flipped;
mod hard_cases;
mod layers;
mod metamorphic;
mod random;
