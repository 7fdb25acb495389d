//! Bytes to texels. The bytes are not trusted: whatever they are, the answer is an image or an error, within bounds of memory.

use std::fmt;
use std::io::Cursor;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::basis;
use super::error::DecodeError;

/// Most texels of an image along each side: what graphics processors take.
const MOST_ALONG_SIDE: u32 = 16_384;

/// Most bytes of an image's texels: a quarter of the largest square, 8,192 texels wide.
pub const MOST_BYTES: u64 = 256 << 20;

/// A decoded image: eight bits for each of red, green, blue and alpha, from the upper left corner on, row by row.
///
/// Images of other depths are converted: sixteen bits are rounded, grey becomes three equal channels, a missing alpha is 255.
#[derive(Clone, PartialEq, Eq)]
pub struct Image {
    width: u32,
    height: u32,
    texels: Vec<[u8; 4]>,
}

impl Image {
    /// An image of these texels, row by row from the upper left corner on; `None` unless they are `width` times `height`, and at
    /// least one.
    #[must_use]
    pub fn new(width: u32, height: u32, texels: Vec<[u8; 4]>) -> Option<Self> {
        let count = u64::from(width) * u64::from(height);
        (count > 0 && texels.len() as u64 == count).then_some(Self { width, height, texels })
    }

    /// Texels of a row.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Number of rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// A texel as it is stored: red, green, blue, alpha. Places outside take the nearest one.
    #[must_use]
    pub fn texel(&self, column: u32, row: u32) -> [u8; 4] {
        let (column, row) = (column.min(self.width - 1), row.min(self.height - 1));
        self.texels[row as usize * self.width as usize + column as usize]
    }

    /// All texels, row by row.
    #[must_use]
    pub fn texels(&self) -> &[[u8; 4]] {
        &self.texels
    }
}

impl fmt::Debug for Image {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        write!(formatter, "Image({} x {})", self.width, self.height)
    }
}

/// Width and height of a PNG, JPEG, WebP or KTX2 image, without decoding it.
///
/// # Errors
/// When the bytes are no such image, or one that is too large.
pub fn dimensions(bytes: &[u8]) -> Result<(u32, u32), DecodeError> {
    let (width, height) = if basis::is_ktx2(bytes) {
        basis::dimensions(bytes)?
    } else {
        reader(bytes)?.into_decoder().map_err(damaged)?.dimensions()
    };
    check_size(width, height)?;
    Ok((width, height))
}

/// Decodes a PNG, JPEG, WebP or KTX2 image. Which of them it is the bytes themselves tell. Colours stay as they are stored: colour profiles,
/// gamma and orientation in the file do not count, as glTF asks for.
///
/// # Errors
/// When the bytes are no such image, or a damaged or too large one.
pub fn decode(bytes: &[u8]) -> Result<Image, DecodeError> {
    let (width, height) = dimensions(bytes)?;
    let texels = if basis::is_ktx2(bytes) {
        basis::texels(bytes)?
    } else {
        let decoder = reader(bytes)?.into_decoder().map_err(damaged)?;
        let texels = DynamicImage::from_decoder(decoder).map_err(damaged)?.into_rgba8();
        texels.into_raw().as_chunks::<4>().0.to_vec()
    };
    Image::new(width, height, texels)
        .ok_or_else(|| DecodeError::Damaged("its texels are not as many as its size says".to_owned()))
}

fn reader(bytes: &[u8]) -> Result<ImageReader<Cursor<&[u8]>>, DecodeError> {
    let format = image::guess_format(bytes).map_err(|_| DecodeError::Format)?;
    if !matches!(format, ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP) {
        return Err(DecodeError::Format);
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_image_width = Some(MOST_ALONG_SIDE);
    limits.max_image_height = Some(MOST_ALONG_SIDE);
    // Sixteen bits a channel take twice the room, and decoders need some of their own.
    limits.max_alloc = Some(4 * MOST_BYTES);
    reader.limits(limits);
    Ok(reader)
}

fn check_size(width: u32, height: u32) -> Result<(), DecodeError> {
    let is_small = width <= MOST_ALONG_SIDE
        && height <= MOST_ALONG_SIDE
        && u64::from(width) * u64::from(height) * 4 <= MOST_BYTES;
    if is_small { Ok(()) } else { Err(DecodeError::TooLarge { width, height }) }
}

fn damaged(error: image::ImageError) -> DecodeError {
    let detail = error.to_string();
    DecodeError::Damaged(detail.lines().next().unwrap_or_default().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four texels, two by two, in this format.
    fn encoded(format: ImageFormat) -> Vec<u8> {
        let image = image::RgbaImage::from_raw(2, 2, TEXELS.concat()).unwrap();
        let mut bytes = Cursor::new(vec![]);
        match format {
            // It knows no alpha.
            ImageFormat::Jpeg => DynamicImage::from(image).into_rgb8().write_to(&mut bytes, format).unwrap(),
            _ => image.write_to(&mut bytes, format).unwrap(),
        }
        bytes.into_inner()
    }

    const TEXELS: [[u8; 4]; 4] = [[255, 0, 0, 255], [0, 255, 0, 128], [0, 0, 255, 0], [10, 20, 30, 40]];

    #[test]
    fn formats_without_loss_give_their_texels() {
        for format in [ImageFormat::Png, ImageFormat::WebP] {
            let image = decode(&encoded(format)).unwrap();
            assert_eq!((image.width(), image.height()), (2, 2));
            assert_eq!(image.texels(), TEXELS);
            assert_eq!((image.texel(1, 0), image.texel(0, 1)), (TEXELS[1], TEXELS[2]));
            assert_eq!(image.texel(7, 7), TEXELS[3]);
        }
    }

    #[test]
    fn jpeg_gives_about_its_colour() {
        let grey = image::RgbImage::from_pixel(16, 8, image::Rgb([180, 90, 40]));
        let mut bytes = Cursor::new(vec![]);
        grey.write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
        let image = decode(&bytes.into_inner()).unwrap();
        assert_eq!((image.width(), image.height()), (16, 8));
        for [red, green, blue, alpha] in image.texels() {
            let worst = red.abs_diff(180).max(green.abs_diff(90)).max(blue.abs_diff(40));
            assert!(worst <= 3 && *alpha == 255, "{red} {green} {blue} {alpha}");
        }
    }

    #[test]
    fn grey_and_deep_images_become_eight_bits_of_four_channels() {
        let written = |image: DynamicImage| {
            let mut bytes = Cursor::new(vec![]);
            image.write_to(&mut bytes, ImageFormat::Png).unwrap();
            decode(&bytes.into_inner()).unwrap().texel(0, 0)
        };
        let grey = image::GrayImage::from_pixel(1, 1, image::Luma([77]));
        assert_eq!(written(grey.into()), [77, 77, 77, 255]);
        let deep = image::ImageBuffer::from_pixel(1, 1, image::Rgba([0xffff_u16, 0x8080, 0, 0x4040]));
        assert_eq!(written(DynamicImage::ImageRgba16(deep)), [255, 128, 0, 64]);
    }

    #[test]
    fn damaged_and_foreign_bytes_are_errors() {
        assert_eq!(decode(b""), Err(DecodeError::Format));
        assert_eq!(decode(b"GIF89a\x01\0\x01\0"), Err(DecodeError::Format));
        for format in [ImageFormat::Png, ImageFormat::WebP, ImageFormat::Jpeg] {
            let whole = encoded(format);
            for end in 0..whole.len() / 2 {
                assert!(decode(&whole[..end]).is_err(), "{format:?} of {end} bytes");
            }
            // One wrong bit may be found or not: it must not panic.
            for bit in 0..8 * whole.len() {
                let mut wrong = whole.clone();
                wrong[bit / 8] ^= 1 << (bit % 8);
                let _ = decode(&wrong);
            }
        }
    }

    #[test]
    fn large_images_are_refused_by_their_header() {
        let mut bytes = encoded(ImageFormat::Png);
        // Width and height follow the signature and the header's name.
        bytes[16..24].copy_from_slice(&[0, 0, 0x30, 0, 0, 0, 0x30, 0]);
        let checksum = crc(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
        let error = DecodeError::TooLarge { width: 0x3000, height: 0x3000 };
        assert_eq!(decode(&bytes), Err(error.clone()));
        assert_eq!(dimensions(&bytes), Err(error));
    }

    /// CRC-32 as PNG has it.
    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0, |sum, byte| {
            (0..8)
                .fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ (0xedb8_8320 & (sum & 1).wrapping_neg()))
        })
    }
}
