/// A lit scene as pictures show it, in a frame that is about 2048 long.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PictureScene {
    /// The triangles, by material.
    pub parts: Vec<Part>,
    /// The images of all textures.
    pub images: Vec<Image>,
    /// How far the same place may lie apart in two parts because coordinates were rounded, in units of the frame.
    pub rounding: f64,
}

/// Triangles of one material. Lists of values per vertex are empty where there is nothing to say.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Part {
    /// Positions of the vertices.
    pub positions: Vec<[f64; 3]>,
    /// Vertices of the triangles, counter-clockwise seen from their fronts.
    pub triangles: Vec<[u32; 3]>,
    /// Irradiance of each vertex; empty for zero.
    pub irradiance: Vec<[f32; 3]>,
    /// Place of each vertex in the image of the irradiance; empty where there is none.
    pub irradiance_coordinates: Vec<[f32; 2]>,
    /// Image that the irradiance is multiplied with: a lightmap.
    pub irradiance_texture: Option<Texture>,
    /// What each vertex multiplies the base colour with: red, green, blue, alpha; empty for one.
    pub colours: Vec<[f32; 4]>,
    /// Place of each vertex in the image of the base colour; empty where there is none.
    pub base_coordinates: Vec<[f32; 2]>,
    /// Place of each vertex in the image of the emission; empty where there is none.
    pub emission_coordinates: Vec<[f32; 2]>,
    /// Diffuse reflectance and opacity: red, green, blue, alpha.
    pub base: [f32; 4],
    /// Image that the base colour is multiplied with.
    pub base_texture: Option<Texture>,
    /// Emitted radiance.
    pub emission: [f32; 3],
    /// Image that the emission is multiplied with.
    pub emission_texture: Option<Texture>,
    /// What becomes of the alpha.
    pub alpha: Alpha,
    /// Shown from the back, too.
    pub double_sided: bool,
}

/// What becomes of the alpha of a surface.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Alpha {
    /// Nothing: the surface is opaque.
    #[default]
    Opaque,
    /// Opaque, or below this cutoff a hole.
    Mask(f32),
    /// It is the opacity.
    Blend,
}

/// An image and how it is looked up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Texture {
    /// Index into [`PictureScene::images`].
    pub image: u32,
    /// What is left and right of it, and what above and below.
    pub wrap: [Wrap; 2],
    /// Nearest pixel instead of linear interpolation of four.
    pub nearest: bool,
}

/// What is beyond the border of an image.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// Its mirror image, then the image again.
    Mirror,
    /// The pixels of the border.
    Clamp,
}

/// An image of four bytes a pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Pixels in a line.
    pub width: u32,
    /// Number of lines.
    pub height: u32,
    /// What the pixels mean.
    pub encoding: Encoding,
    /// Red, green, blue and alpha, line by line from the top.
    pub pixels: bytes::Bytes,
}

/// What the pixels of an image mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Encoding {
    /// Colours as sRGB encodes them, and alpha as it is.
    Srgb,
    /// Linear: red, green and blue times alpha, and opaque. For light, whose bright and dark parts lie far apart.
    Rgbm,
}
