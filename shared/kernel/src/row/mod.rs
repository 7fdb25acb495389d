//! Rows of form factors: what is asked for, and how the answer travels.
//!
//! The row of a shooter holds, for every receiver, the factor by which the shooter's radiosity becomes the receiver's
//! irradiance: the form factor from the *receiver's point* to the shooter's surface, times its visibility. Seen from this
//! end the sum over the shooters that enclose a point is 1 at every vertex, corners included, and no ratio of areas
//! appears.

mod codec;
mod error;
mod job;
mod request;
mod rounding;
mod shooter;
mod shooter_message;
mod sparse;

pub use codec::{RowDecodeError, decode_row, encode_row, longest_encoded_row};
pub use error::RequestError;
pub use job::{FinishedJob, JobId};
pub use request::{Precision, RowRequest};
pub use rounding::Rounding;
pub use shooter::{CHANNELS, Channel, Hemisphere, Shape, Shooter, Spot, WeightedPolygons};
pub use sparse::{GROUP, Place, Row};

/// Version of the bits of rows. Files and workers of another version are refused, because rows of both would not fit together. Bump it
/// whenever a change of the kernel changes a bit of any row.
pub const ROW_VERSION: u32 = 14;

/// Line that names this release in files of rows or of light: rows and meshes of another release may have other bits.
#[must_use]
pub fn release() -> String {
    format!("{} rows {ROW_VERSION}", env!("CARGO_PKG_VERSION"))
}
