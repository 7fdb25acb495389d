//! KTX2 images of KHR_texture_basisu, ETC1S or UASTC, to texels.
//!
//! The transcoder trusts the ranges and lengths that a file states, so they are checked before.

use basisu::{DecodeFlags, TargetFormat, Transcoder};
use ktx2::{ColorModel, Reader};

use super::image::DecodeError;

/// First bytes of a KTX2 file.
const SIGNATURE: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Texels of a block along each side.
const BLOCK: u32 = 4;

/// Bytes of a block of UASTC.
const BLOCK_BYTES: u64 = 16;

/// Whether the bytes begin as a KTX2 file does.
pub(super) fn is_ktx2(bytes: &[u8]) -> bool {
    bytes.starts_with(SIGNATURE)
}

/// Width and height of the first level.
///
/// # Errors
/// When the bytes are no single image of ETC1S or UASTC, or their parts do not fit.
pub(super) fn dimensions(bytes: &[u8]) -> Result<(u32, u32), DecodeError> {
    let file = Reader::new(bytes).map_err(|error| DecodeError::Damaged(error.to_string()))?;
    let header = file.header();
    let (width, height) = (header.pixel_width, header.pixel_height);
    let is_single =
        height > 0 && header.pixel_depth == 0 && header.layer_count <= 1 && header.face_count == 1;
    if !is_single || ![Some(ColorModel::ETC1S), Some(ColorModel::UASTC)].contains(&file.color_model()) {
        return Err(DecodeError::Format);
    }
    let blocks = u64::from(width.div_ceil(BLOCK)) * u64::from(height.div_ceil(BLOCK));
    // That of ETC1S, which is coded as a whole, may be 0.
    if file.levels().next().is_none_or(|level| level.uncompressed_byte_length > blocks * BLOCK_BYTES) {
        return Err(DecodeError::Damaged("the length of its first level does not fit its size".to_owned()));
    }
    Ok((width, height))
}

/// The texels of the first level, row by row from the upper left corner on: `width` times `height` of [`dimensions`], which must
/// have accepted the bytes.
///
/// # Errors
/// When the blocks are damaged.
pub(super) fn texels(bytes: &[u8]) -> Result<Vec<[u8; 4]>, DecodeError> {
    let decoded = Transcoder::new(bytes)
        .and_then(|image| image.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE))
        .map_err(|_| DecodeError::Damaged("its blocks cannot be decoded".to_owned()))?;
    Ok(decoded.as_chunks::<4>().0.to_vec())
}

#[cfg(test)]
mod tests {
    use super::super::image::{decode, dimensions};
    use super::*;

    /// Both encodings of ten by seven texels.
    const UASTC: &[u8] = include_bytes!("../../../../tests/fuzz/seeds/images/uastc.ktx2");
    const ETC1S: &[u8] = include_bytes!("../../../../tests/fuzz/seeds/images/etc1s.ktx2");

    /// The texels that were encoded: three by two squares of four by four, cut at the right and at the bottom.
    const SQUARES: [[[u8; 4]; 3]; 2] = [
        [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]],
        [[200, 120, 40, 255], [90, 90, 90, 128], [255, 255, 255, 0]],
    ];

    #[test]
    fn both_encodings_give_the_texels_that_were_encoded() {
        for (bytes, most) in [(UASTC, 0), (ETC1S, 3)] {
            assert_eq!(dimensions(bytes), Ok((10, 7)));
            let image = decode(bytes).unwrap();
            for (column, row) in (0..7).flat_map(|row| (0..10).map(move |column| (column, row))) {
                let (found, wanted) =
                    (image.texel(column, row), SQUARES[row as usize / 4][column as usize / 4]);
                let worst = found.iter().zip(wanted).map(|(found, wanted)| found.abs_diff(wanted)).max();
                assert!(worst <= Some(most), "{found:?} for {wanted:?} at {column}, {row}");
            }
        }
    }

    /// The bytes with this 64-bit number of its header or index of levels replaced.
    fn with(bytes: &[u8], at: usize, value: u64) -> Vec<u8> {
        let mut changed = bytes.to_vec();
        changed[at..at + 8].copy_from_slice(&value.to_le_bytes());
        changed
    }

    #[test]
    fn images_that_are_not_single_or_of_other_encodings_are_refused() {
        // Layers and faces stand side by side.
        let (of_layers, cube) = (with(UASTC, 32, 2 | 1 << 32), with(UASTC, 32, 6 << 32));
        let mut other = UASTC.to_vec();
        let model = u32::from_le_bytes(UASTC[48..52].try_into().unwrap()) as usize + 12;
        assert_eq!(other[model], ColorModel::UASTC.value());
        other[model] = ColorModel::BC7.value();
        for refused in [of_layers, cube, other] {
            assert_eq!(decode(&refused), Err(DecodeError::Format));
        }
    }

    #[test]
    fn stated_lengths_take_no_memory_and_no_wrong_bit_panics() {
        // The third number of the index of levels, which follows the header.
        let long = with(UASTC, 96, 1 << 50);
        assert!(matches!(decode(&long), Err(DecodeError::Damaged(_))));
        let large = with(UASTC, 20, 0x3000 | 0x3000 << 32);
        assert_eq!(decode(&large), Err(DecodeError::TooLarge { width: 0x3000, height: 0x3000 }));
        for whole in [UASTC, ETC1S] {
            for end in 0..whole.len() - 1 {
                assert!(decode(&whole[..end]).is_err(), "{end} bytes");
            }
            for bit in 0..8 * whole.len() {
                let mut wrong = whole.to_vec();
                wrong[bit / 8] ^= 1 << (bit % 8);
                let _ = decode(&wrong);
            }
        }
    }
}
