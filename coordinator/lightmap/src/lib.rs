//! Lightmaps: texture coordinates over the surfaces of a scene, texels as points that a bake can be asked about, and images of their
//! light.
//!
//! In: a [`scene::Scene`] and a texel size. Out: a [`Plan`] with the points, before the bake, and a [`Lightmap`] from the light
//! there, after it. It must not know how light is computed, or how images are written. Begin reading at [`plan()`].
//!
//! Each module may use those below it:
//!
//! | module | what lives there |
//! |---|---|
//! | `plan` | from a scene to texels; [`Plan::lightmap`]: from their light to images |
//! | `own_set` | the input's second set of texture coordinates, checked |
//! | `texels` | the point of each texel, and which texels lie inside of something |
//! | `pieces` | what of each texel the triangles cover |
//! | `lattice` | which texels lie between others, whose mean light may be theirs |
//! | `seams` | texels on both sides of a border between charts made to agree |
//! | `unwrap` | charts made and packed, where the input has none |
//! | `instances` | sides of one mesh at several nodes |
//! | `fill` | texels without light, filled from their neighbours |
//! | `layout` | the vertices and triangles of each side with their coordinates |
//! | `raster` | which texels a triangle covers |
//! | `meetings` | where light goes on over an edge, and where charts end |
//! | `sides` | the lit sides of the input's primitives |
//! | `error` | why there is no lightmap |

mod error;
mod fill;
mod instances;
mod lattice;
mod layout;
mod meetings;
mod own_set;
mod pieces;
mod plan;
mod raster;
mod seams;
mod sides;
#[cfg(test)]
mod tests;
mod texels;
mod unwrap;

pub use error::{LightmapError, MOST_TEXELS, Stop};
pub use layout::{SharedLayout, SideLayout};
pub use plan::{Lightmap, Plan, PlanReport, plan};
pub use unwrap::Resolution;
