//! Why there is no lightmap.

/// Most texels that surfaces may have: a plan of as many takes some gigabytes.
pub const MOST_TEXELS: u64 = 1 << 24;

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
