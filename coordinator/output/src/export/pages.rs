//! The pages of a lightmap as image files.

use std::io::Cursor;

use exr::prelude::{Compression, Layers};
use exr::prelude::{
    Encoding, Image, ImageAttributes, IntegerBounds, Layer, LayerAttributes, LineOrder, SpecificChannels,
    Text, WritableImage, f16,
};
use glam::DVec3;

use super::ExportError;
use crate::render::srgb_byte;

/// How the pages of a lightmap are written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PageFormat {
    /// PNG of eight bits with the curve of sRGB: 1 stands for the largest irradiance.
    #[default]
    Png,
    /// PNG of eight bits, linear, with the multiplier in alpha.
    Rgbm,
    /// As [`Png`](Self::Png), and OpenEXR of half floats beside the output.
    Exr,
    /// As [`Png`](Self::Png), and KTX2 of BC6H beside the output.
    Ktx2,
}

impl PageFormat {
    /// How the names of the files end that are written beside the output, one of each page; `None` where there are none.
    #[must_use]
    pub fn beside(self) -> Option<&'static str> {
        match self {
            Self::Png | Self::Rgbm => None,
            Self::Exr => Some("exr"),
            Self::Ktx2 => Some("ktx2"),
        }
    }

    /// The name of the encoding of its PNGs, as the output's extras have it.
    pub(super) fn encoding(self) -> &'static str {
        match self {
            Self::Png | Self::Exr | Self::Ktx2 => "srgb",
            Self::Rgbm => "rgbm",
        }
    }
}

/// The largest irradiance of some pages, or 1 where all are black.
pub(super) fn largest<'a>(pages: impl IntoIterator<Item = &'a Vec<[f32; 3]>>) -> f32 {
    let largest = pages.into_iter().flatten().flatten().copied().fold(0.0, f32::max);
    if largest > 0.0 { largest } else { 1.0 }
}

/// A page as PNG. `scale`: the irradiance that 1 stands for.
pub(super) fn png(
    page: &[[f32; 3]],
    size: [u32; 2],
    format: PageFormat,
    scale: f32,
) -> Result<Vec<u8>, ExportError> {
    let (bytes, colour): (Vec<u8>, _) = match format {
        PageFormat::Png | PageFormat::Exr | PageFormat::Ktx2 => {
            let byte = |value: &f32| srgb_byte((f64::from(*value) / f64::from(scale)).clamp(0.0, 1.0));
            (page.iter().flatten().map(byte).collect(), png::ColorType::Rgb)
        }
        PageFormat::Rgbm => {
            (page.iter().flat_map(|texel| rgbm(*texel, scale)).collect(), png::ColorType::Rgba)
        }
    };
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, size[0], size[1]);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(|error| ExportError::Image(error.to_string()))?;
    writer.write_image_data(&bytes).map_err(|error| ExportError::Image(error.to_string()))?;
    writer.finish().map_err(|error| ExportError::Image(error.to_string()))?;
    Ok(file)
}

/// Irradiance = red, green or blue x alpha x scale, all in [0, 1].
fn rgbm(texel: [f32; 3], scale: f32) -> [u8; 4] {
    let texel = DVec3::from_array(texel.map(f64::from)) / f64::from(scale);
    let multiplier = (texel.max_element() * 255.0).ceil().clamp(1.0, 255.0);
    let [red, green, blue] = (texel * (255.0 * 255.0 / multiplier)).to_array();
    [red, green, blue, multiplier].map(|value| value.round().clamp(0.0, 255.0) as u8)
}

/// A page as OpenEXR of half floats: one layer for each of `layers`. Several have a name each.
pub(super) fn exr(layers: &[(Option<&str>, &[[f32; 3]])], size: [u32; 2]) -> Result<Vec<u8>, ExportError> {
    let [width, height] = size.map(|side| side as usize);
    let encoding = Encoding {
        compression: Compression::ZIP16,
        line_order: LineOrder::Increasing,
        ..Encoding::FAST_LOSSLESS
    };
    let layer = |(name, page): &(Option<&str>, &[[f32; 3]])| {
        let page = page.to_vec();
        let channels = SpecificChannels::rgb(move |place: exr::math::Vec2<usize>| {
            let [red, green, blue] = page[place.y() * width + place.x()].map(half);
            (red, green, blue)
        });
        let attributes = LayerAttributes {
            layer_name: name.map(Text::from),
            software_name: Some(Text::from("Halflight")),
            ..LayerAttributes::default()
        };
        Layer::new((width, height), attributes, encoding, channels)
    };
    let bounds = IntegerBounds::from_dimensions((width, height));
    let layers: Layers<_> = layers.iter().map(layer).collect();
    let mut file = Cursor::new(Vec::new());
    let image = Image::from_layers(ImageAttributes::new(bounds), layers);
    let written = image.write().non_parallel().to_buffered(&mut file);
    written.map_err(|error| ExportError::Image(error.to_string()))?;
    Ok(file.into_inner())
}

/// The nearest half float that is light: these end at 65504, and rounding may leave less than none.
pub(super) fn half(value: f32) -> f16 {
    f16::from_f32(value.clamp(0.0, f16::MAX.to_f32()))
}

#[cfg(test)]
mod tests {
    use exr::prelude::{ReadChannels, ReadLayers};

    use super::*;

    #[test]
    fn multipliers_keep_dark_texels_within_a_part_in_two_hundred() {
        for exponent in 0..8 {
            let value = 0.73 / f32::powi(2.0, exponent);
            let [red, green, blue, multiplier] = rgbm([value * 10.0, value * 5.0, 0.0], 10.0);
            let decoded = f32::from(red) / 255.0 * f32::from(multiplier) / 255.0;
            assert!((decoded / value - 1.0).abs() < 0.005, "{decoded} {value}");
            assert!((f32::from(green) * 2.0 - f32::from(red)).abs() <= 1.0);
            assert_eq!(blue, 0);
        }
        assert_eq!(rgbm([0.0; 3], 1.0), [0, 0, 0, 1]);
    }

    #[test]
    fn exr_has_half_floats_in_layers_with_names() {
        let page = [[0.5, 1.0, 70_000.0], [2.0, 0.25, 0.0]];
        let file = exr(&[(Some("lightmap"), &page), (Some("day"), &page)], [2, 1]).unwrap();
        let read = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .from_buffered(Cursor::new(file))
            .unwrap();
        assert_eq!(read.layer_data.len(), 2);
        assert_eq!(read.layer_data[1].attributes.layer_name, Some(Text::from("day")));
        let red = read.layer_data[0].channel_data.list.iter().find(|c| c.name == *"R").unwrap();
        assert_eq!(red.sample_data.values_as_f32().collect::<Vec<_>>(), [0.5, 2.0]);
    }
}
