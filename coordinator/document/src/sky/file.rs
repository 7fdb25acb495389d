//! Skies of files of their own.

use std::io::Cursor;
use std::path::Path;

use exr::math::Vec2;
use exr::meta::MetaData;
use exr::prelude::{ReadChannels, ReadLayers, read};
use glam::DQuat;
use image::{ImageFormat, ImageReader, Limits};

use super::{MOST_WIDTH, Projection, SkyError, SkyImage};
use crate::beside::read_file;

/// Most bytes of a file: four floats for each texel, and as much around them.
const MOST_BYTES: u64 = 32 * (MOST_WIDTH * MOST_WIDTH / 2) as u64;

impl SkyImage {
    /// Reads an equirectangular image: OpenEXR, or Radiance HDR. Which of them it is the bytes tell. Values below 0, which some colour
    /// conversions leave, become 0.
    ///
    /// # Errors
    /// When the file cannot be read, or holds no such image.
    pub fn open(path: &Path) -> Result<Self, SkyError> {
        let bytes = read_file(path, MOST_BYTES)?
            .ok_or_else(|| SkyError::Damaged(format!("it has more than {MOST_BYTES} bytes")))?;
        Self::from_bytes(&bytes)
    }

    /// As [`SkyImage::open`], from the bytes of the file.
    ///
    /// # Errors
    /// When they are no such image.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SkyError> {
        let ([width, height], mut texels) = if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
            read_exr(bytes)?
        } else if bytes.starts_with(b"#?") {
            read_hdr(bytes)?
        } else {
            return Err(SkyError::Format);
        };
        if let Some(place) = texels.iter().position(|texel| !texel.iter().all(|value| value.is_finite())) {
            return Err(SkyError::NotFinite { column: place % width, row: place / width });
        }
        texels.iter_mut().flatten().for_each(|value| *value = value.max(0.0));
        let projection = Projection::Equirectangular { width, height };
        Ok(Self { projection, texels, rotation: DQuat::IDENTITY })
    }
}

fn check_size(width: usize, height: usize) -> Result<(), SkyError> {
    if width == 0 || width != 2 * height {
        return Err(SkyError::Shape { width, height });
    }
    if width > MOST_WIDTH { Err(SkyError::TooLarge { width, height }) } else { Ok(()) }
}

/// Width and height of an image, and its texels.
type Read = ([usize; 2], Vec<[f32; 3]>);

fn read_exr(bytes: &[u8]) -> Result<Read, SkyError> {
    let damaged = |error: exr::error::Error| SkyError::Damaged(error.to_string());
    // Nothing is set aside for texels before their number is known.
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    for header in &meta.headers {
        check_size(header.layer_size.width(), header.layer_size.height())?;
    }
    let empty = |size: Vec2<usize>, _: &_| (size.width(), vec![[0.0; 3]; size.area()]);
    let put =
        |(width, texels): &mut (usize, Vec<[f32; 3]>), place: Vec2<usize>, (r, g, b): (f32, f32, f32)| {
            texels[place.y() * *width + place.x()] = [r, g, b];
        };
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(empty, put)
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    let size = image.layer_data.size;
    Ok(([size.width(), size.height()], image.layer_data.channel_data.pixels.1))
}

fn read_hdr(bytes: &[u8]) -> Result<Read, SkyError> {
    let damaged = |error: image::ImageError| SkyError::Damaged(error.to_string());
    let reader = || {
        let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Hdr);
        let mut limits = Limits::default();
        limits.max_alloc = Some(MOST_BYTES);
        reader.limits(limits);
        reader
    };
    let (width, height) = reader().into_dimensions().map_err(damaged)?;
    let size = [width, height].map(|side| side as usize);
    check_size(size[0], size[1])?;
    let texels = reader().decode().map_err(damaged)?.into_rgb32f().into_raw();
    Ok((size, texels.as_chunks::<3>().0.to_vec()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Radiance HDR without compression.
    fn hdr(width: usize, height: usize, texels: &[[u8; 4]]) -> Vec<u8> {
        let head = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n");
        head.into_bytes().into_iter().chain(texels.iter().flatten().copied()).collect()
    }

    fn exr(width: usize, height: usize, texel: impl Fn(usize, usize) -> (f32, f32, f32) + Sync) -> Vec<u8> {
        use exr::prelude::{Image, SpecificChannels, WritableImage};
        let channels = SpecificChannels::rgb(|place: Vec2<usize>| texel(place.x(), place.y()));
        let mut bytes = Cursor::new(vec![]);
        Image::from_channels((width, height), channels).write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn both_formats_are_read() {
        let read = SkyImage::from_bytes(&hdr(2, 1, &[[128, 64, 0, 129], [1, 2, 3, 128]])).unwrap();
        assert_eq!(read.texels, [[1.0, 0.5, 0.0], [1.0 / 256.0, 2.0 / 256.0, 3.0 / 256.0]]);
        let read = SkyImage::from_bytes(&exr(4, 2, |x, y| (x as f32, y as f32, -1.0))).unwrap();
        assert_eq!(read.projection, Projection::Equirectangular { width: 4, height: 2 });
        assert_eq!(read.texels[7], [3.0, 1.0, 0.0]);
    }

    #[test]
    fn what_is_no_sky_is_refused() {
        let wrong = |bytes: &[u8]| SkyImage::from_bytes(bytes).unwrap_err().to_string();
        assert!(wrong(b"PNG").contains("neither"));
        assert!(wrong(&hdr(3, 1, &[[0; 4]; 3])).contains("twice as wide"));
        assert!(wrong(&hdr(20_000, 10_000, &[])).contains("scale it down"));
        assert!(wrong(&hdr(4, 2, &[[0; 4]; 3])).contains("damaged"));
        assert!(wrong(&exr(4, 3, |_, _| (1.0, 1.0, 1.0))).contains("twice as wide"));
        let bytes = exr(4, 2, |x, y| (if (x, y) == (1, 1) { f32::INFINITY } else { 1.0 }, 1.0, 1.0));
        assert!(wrong(&bytes).contains("column 1, row 1"));
        assert!(wrong(&bytes[..bytes.len() / 2]).contains("damaged"));
    }
}
