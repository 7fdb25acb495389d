//! Why there are no probes.

/// Most probes: the file that they come in has some megabytes then.
pub const MOST_PROBES: usize = 1 << 15;

/// Why a scene can have no such probes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProbeError {
    /// The grid is too fine for the scene.
    #[error(
        "a grid of probes {spacing} apart would have {probes:.1e} of them, and at most {MOST_PROBES} are allowed: give --probes \
         {least:.2e} or more"
    )]
    TooFine {
        /// Distance of neighbours, units of the file.
        spacing: f64,
        /// Probes that the grid would have.
        probes: f64,
        /// A spacing that is allowed.
        least: f64,
    },
    /// More points than are allowed.
    #[error("{0} probes are too many: give {MOST_PROBES} points at most")]
    TooMany(usize),
    /// A point far from the scene.
    #[error("probe {0} lies too far from the scene: give points near it, in units of the file")]
    Far(usize),
}
