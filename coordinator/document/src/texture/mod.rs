//! Images, decoded and sampled at points.
//!
//! | file | what it does |
//! |---|---|
//! | `image` | PNG, JPEG, WebP and KTX2 to texels, within bounds of size and memory |
//! | `basis` | the encodings of KTX2 that glTF has |
//! | `encoding` | sRGB to linear |
//! | `error` | why an image cannot be read |
//! | `sampler` | wrapping and filtering |
//! | `mapping` | texture coordinates to places on the image |
//!
//! Texture coordinates are as in glTF: (0, 0) is the upper left corner of the image, (1, 1) the lower right one, whatever its size.

mod basis;
mod encoding;
mod error;
mod image;
mod mapping;
mod sampler;

pub use encoding::{Encoding, linear_to_srgb, srgb_to_linear};
pub use error::DecodeError;
pub use image::{Image, MOST_BYTES, decode, dimensions};
pub use mapping::Mapping;
pub(crate) use mapping::check_transforms;
pub use sampler::{Filter, Sampler, Wrap};
