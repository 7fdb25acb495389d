//! Pictures of lit scenes: their contents, and requests for tiles.
//!
//! | module | what lives there |
//! |---|---|
//! | `scene` | lit triangles with colours and textures |
//! | `replica` | how they travel |
//! | `camera` | from a place in the picture to a ray |
//! | [`tracer`] | the pixels of a tile |
//! | `tile` | one rectangle of a picture: request and answer |

mod camera;
mod replica;
mod scene;
mod tile;
pub mod tracer;

pub use camera::{Camera, Projection, Ray};
pub use replica::{decode_picture, encode_picture};
pub use scene::{Alpha, Encoding, Image, Part, PictureScene, Texture, Wrap};
pub use tile::{
    FinishedTile, MOST_SAMPLES, MOST_SIDE, MOST_TILE_RAYS, Pixels, TileError, TileRequest, TileService,
    decode_pixels, encode_pixels,
};
