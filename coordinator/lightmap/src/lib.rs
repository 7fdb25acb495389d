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
//! | `unwrap` | charts made and packed, where the input has none |
//! | `layout` | the vertices and triangles of each side with their coordinates |
//! | `texels` | the point of each texel, and which texels lie inside of something |
//! | `seams` | texels on both sides of a border between charts made to agree |
//! | `fill` | texels without light, filled from their neighbours |
//! | `raster` | which texels a triangle covers |
//! | `sides` | the lit sides of the input's primitives |

mod fill;
mod layout;
mod own_set;
mod plan;
mod raster;
mod seams;
mod sides;
#[cfg(test)]
mod tests;
mod texels;
mod unwrap;

pub use layout::SideLayout;
pub use plan::{Lightmap, Plan, PlanReport, Resolution, plan};
pub use unwrap::MOST_TEXELS;

/// Why a scene can have no lightmap of this resolution.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LightmapError {
    /// The texels are too small for the surfaces.
    #[error(
        "a lightmap with texels of {texel} would need {texels:.1e} texels, and at most {MOST_TEXELS} are allowed: give a \
         --texel-size of {least:.2e} or more"
    )]
    TooManyTexels {
        /// Edge of a texel, units of the file.
        texel: f64,
        /// Texels that the surfaces would need.
        texels: f64,
        /// A texel size that is allowed.
        least: f64,
    },
    /// The charts do not fit.
    #[error("the lightmap cannot be laid out: {0}; give a larger --texel-size or --lightmap-size")]
    Layout(String),
    /// A primitive with so many vertices that charts cannot add to them.
    #[error("{0} has too many vertices for a lightmap: split its mesh")]
    TooManyVertices(String),
    /// The caller wants the plan no more.
    #[error("the lightmap was cancelled")]
    Cancelled,
}

/// Asks whether to stop, from any thread.
pub type Stop<'a> = &'a (dyn Fn() -> bool + Sync);
