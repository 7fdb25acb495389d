//! Pictures of lit files.
//!
//! | module | what lives there |
//! |---|---|
//! | `file` | a lit file as a picture's scene |
//! | `materials` | its materials |
//! | `images` | its images |
//! | `cameras` | its cameras, and those of the user |
//! | `view` | an automatic view |
//! | `tiles` | the picture in tiles, computed by workers |
//! | `exposure`, `tone` | radiance to display colours |
//! | `write` | PNG and EXR |
//!
//! The radiance of a surface is reflectance x irradiance / pi + emission. How a file is read is the reverse of how
//! [`crate::export`] writes it:
//!
//! - Irradiance is `_IRRADIANCE`; without it that of the material's lightmap; without any in the file `COLOR_0` over the file's
//!   exposure; without an exposure `COLOR_0` itself, which then means what it does in any viewer.
//! - Reflectance is base colour factor x texture x `_COLOR_0`, or with a lightmap `COLOR_0`, times 1 - metallic factor where no
//!   texture says what is metal. Light out of `COLOR_0` has the last two in it already.
//! - Emission is emissive factor x strength x texture, where the material is not unlit.

mod cameras;
mod exposure;
mod file;
mod images;
mod materials;
#[cfg(test)]
mod tests;
mod tiles;
mod tone;
mod view;
mod write;

pub use cameras::{CameraChoice, CameraError, FileCamera, LookAt};
pub use exposure::suitable_exposure;
pub use file::{LightOfFile, LitFile, read_lit};
pub use tiles::{Picture, RenderError, TileSettings, render_tiles};
pub(crate) use tone::srgb_byte;
pub use tone::{ToneMap, display_colour};
pub use view::choose_view;
pub use write::{Caption, PictureFormat, encode_exr, encode_png};
