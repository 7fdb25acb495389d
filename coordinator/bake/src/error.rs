use std::error::Error;

/// A result of the bake.
pub type Result<T, E = BakeError> = std::result::Result<T, E>;

/// Why a bake failed.
#[derive(Debug, thiserror::Error)]
pub enum BakeError {
    /// Nothing is left of the scene after welding.
    #[error("the scene has no surface large enough to hold a patch")]
    EmptyMesh,
    /// The arithmetic failed: better no output than a black one.
    #[error("the solution is not finite: please report the scene as a fault of this program")]
    NotFinite,
    /// A group names a light that the scene does not have.
    #[error("group {group}: the scene has no light {light}; its lights are: {known}")]
    UnknownLight {
        /// The group.
        group: String,
        /// The unknown name.
        light: String,
        /// The names that the scene has.
        known: String,
    },
    /// Cancelled by the observer.
    #[error("the bake was cancelled")]
    Cancelled,
    /// No more rows.
    #[error("rows cannot be computed: {0}")]
    Rows(#[source] Box<dyn Error + Send + Sync>),
}
