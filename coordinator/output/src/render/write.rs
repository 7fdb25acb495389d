//! Pictures as files.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{
    Compression, Encoding, Image, ImageAttributes, IntegerBounds, Layer, LayerAttributes, LineOrder,
    SpecificChannels, Text, WritableImage,
};
use glam::DVec3;

use super::tone::srgb_byte;
use super::{Picture, ToneMap};

/// Metadata of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Caption {
    /// Display value per unit of irradiance on white: a PNG shows pi x radiance x exposure.
    pub exposure: f64,
    /// Tone mapping.
    pub tone_map: ToneMap,
    /// Description of the camera.
    pub camera: String,
    /// Rays for each pixel.
    pub samples: u32,
}

/// Format of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// Eight bits of sRGB, tone-mapped.
    Png,
    /// Radiance, linear and unclamped.
    Exr,
}

impl PictureFormat {
    /// The format that a file's name stands for.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "png" => Some(Self::Png),
            "exr" => Some(Self::Exr),
            _ => None,
        }
    }
}

/// A picture as PNG: eight bits of sRGB, with the caption in text chunks.
///
/// # Errors
/// When the encoder refuses it.
pub fn encode_png(picture: &Picture, caption: &Caption) -> Result<Vec<u8>, png::EncodingError> {
    let colours = caption.tone_map.apply(picture, caption.exposure);
    let bytes: Vec<u8> =
        colours.iter().map(DVec3::to_array).flat_map(|colour| colour.map(srgb_byte)).collect();
    let mut file = Vec::new();
    let [width, height] = picture.size;
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    for (keyword, text) in caption.lines() {
        encoder.add_text_chunk(keyword.to_owned(), text)?;
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&bytes)?;
    writer.finish()?;
    Ok(file)
}

/// A picture as OpenEXR: floats of linear radiance with the primaries of sRGB, unclamped and not exposed, with the caption in the
/// attribute `comments`.
///
/// # Errors
/// When the encoder refuses it.
pub fn encode_exr(picture: &Picture, caption: &Caption) -> Result<Vec<u8>, exr::error::Error> {
    let [width, height] = picture.size.map(|side| side as usize);
    let channels = SpecificChannels::rgb(|place: exr::math::Vec2<usize>| {
        let [red, green, blue] = picture.pixels[place.y() * width + place.x()];
        (red, green, blue)
    });
    let comments: Vec<String> =
        caption.lines().into_iter().map(|(keyword, text)| format!("{keyword}: {text}")).collect();
    let attributes = LayerAttributes {
        software_name: Some(Text::from("Halflight")),
        comments: Some(Text::from(comments.join("\n").as_str())),
        ..LayerAttributes::default()
    };
    let encoding = Encoding {
        compression: Compression::ZIP16,
        line_order: LineOrder::Increasing,
        ..Encoding::FAST_LOSSLESS
    };
    let layer = Layer::new((width, height), attributes, encoding, channels);
    let bounds = IntegerBounds::from_dimensions((width, height));
    let image = Image::empty(ImageAttributes::new(bounds)).with_layer(layer);
    let mut file = Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut file)?;
    Ok(file.into_inner())
}

impl Caption {
    fn lines(&self) -> [(&'static str, String); 5] {
        [
            ("Software", format!("Halflight {}", env!("CARGO_PKG_VERSION"))),
            ("Exposure", format!("{} (display value per unit of irradiance on white)", self.exposure)),
            ("Tone map", self.tone_map.name().to_owned()),
            ("Camera", self.camera.clone()),
            ("Samples", self.samples.to_string()),
        ]
    }
}
