//! What can be wrong with an image.

/// Why an image cannot be decoded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// Another format, or none.
    #[error("it is neither PNG, JPEG, WebP nor KTX2 of ETC1S or UASTC; convert it to PNG")]
    Format,
    /// Too wide, too high, or too much of both.
    #[error(
        "it has {width} x {height} texels, more than can be taken; scale it down to {most} x {most} or less",
        most = 8192
    )]
    TooLarge {
        /// Texels of a row.
        width: u32,
        /// Number of rows.
        height: u32,
    },
    /// The decoder gave up.
    #[error("it is damaged: {0}; export it again")]
    Damaged(String),
}
