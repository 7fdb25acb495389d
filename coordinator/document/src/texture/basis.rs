//! KTX2 images of KHR_texture_basisu, ETC1S or UASTC, to texels.
//!
//! The transcoder trusts the lengths that a file states, and may panic on damaged blocks: it gets checked bytes, without what it does
//! not need, and a panic of it is an error.

use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};

use basisu::{DecodeFlags, TargetFormat, Transcoder};
use ktx2::{ColorModel, Header, LevelIndex, SupercompressionScheme};
use ruzstd::decoding::StreamingDecoder;

use super::error::DecodeError;

/// First bytes of a KTX2 file.
const SIGNATURE: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Texels of a block along each side.
const BLOCK: u32 = 4;

/// Bytes of a block of UASTC.
const BLOCK_BYTES: u64 = 16;

/// Place of the colour model in the description of the format.
const COLOUR_MODEL: usize = 12;

/// Places in the header: the scheme of compression, and where key and value data are.
const SCHEME: usize = 44;
const KEY_VALUES: usize = 56;

/// Whether the bytes begin as a KTX2 file does.
pub(super) fn is_ktx2(bytes: &[u8]) -> bool {
    bytes.starts_with(SIGNATURE)
}

/// Width and height of the first level.
///
/// # Errors
/// When the bytes are no single image of ETC1S or UASTC, or their parts do not fit.
pub(super) fn dimensions(bytes: &[u8]) -> Result<(u32, u32), DecodeError> {
    let Container { header, .. } = container(bytes)?;
    Ok((header.pixel_width, header.pixel_height))
}

/// The texels of the first level, row by row from the upper left corner on: as many as [`dimensions`] says.
///
/// # Errors
/// As [`dimensions`], and when the blocks are damaged.
pub(super) fn texels(bytes: &[u8]) -> Result<Vec<[u8; 4]>, DecodeError> {
    let bytes = without_extras(bytes, &container(bytes)?)?;
    let decode = || {
        let image = Transcoder::new(&bytes)?;
        image.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE)
    };
    let decoded = catch_unwind(AssertUnwindSafe(decode)).ok().and_then(Result::ok);
    let decoded = decoded.ok_or_else(|| damaged("its blocks cannot be decoded"))?;
    Ok(decoded.as_chunks::<4>().0.to_vec())
}

/// The parts of a file that count, all of them within it.
struct Container {
    header: Header,
    level: LevelIndex,
}

fn container(bytes: &[u8]) -> Result<Container, DecodeError> {
    let outside = || damaged("a part of it lies outside");
    let at = |offset: u64, length: u64| {
        let range = usize::try_from(offset).ok()..usize::try_from(offset.checked_add(length)?).ok();
        bytes.get(range.start?..range.end?)
    };
    let first = bytes.first_chunk().ok_or_else(outside)?;
    let header = Header::from_bytes(first).map_err(|error| damaged(&error.to_string()))?;
    let levels = bytes[Header::LENGTH..].first_chunk().ok_or_else(outside)?;
    let level = LevelIndex::from_bytes(levels);
    let index = header.index;
    let description = at(index.dfd_byte_offset.into(), index.dfd_byte_length.into()).ok_or_else(outside)?;
    at(index.sgd_byte_offset, index.sgd_byte_length).ok_or_else(outside)?;
    at(level.byte_offset, level.byte_length).ok_or_else(outside)?;

    let is_single = header.pixel_height > 0
        && header.pixel_depth == 0
        && header.layer_count <= 1
        && header.face_count == 1;
    let model = description.get(COLOUR_MODEL).and_then(|model| ColorModel::new(*model));
    if !is_single || ![Some(ColorModel::ETC1S), Some(ColorModel::UASTC)].contains(&model) {
        return Err(DecodeError::Format);
    }
    Ok(Container { header, level })
}

/// The file without key and value data, and its first level as it is before compression by Zstandard.
fn without_extras(bytes: &[u8], Container { header, level }: &Container) -> Result<Vec<u8>, DecodeError> {
    let mut plain = bytes.to_vec();
    plain[KEY_VALUES..KEY_VALUES + 8].fill(0);
    if header.supercompression_scheme == Some(SupercompressionScheme::Zstandard) {
        let blocks =
            u64::from(header.pixel_width.div_ceil(BLOCK)) * u64::from(header.pixel_height.div_ceil(BLOCK));
        let length = blocks * BLOCK_BYTES;
        let failed = |_| damaged("its first level cannot be unpacked");
        let packed = &bytes[level.byte_offset as usize..][..level.byte_length as usize];
        let offset = plain.len();
        let unpacked =
            StreamingDecoder::new(packed).map_err(|_| damaged("its first level is not packed as it says"))?;
        unpacked.take(length).read_to_end(&mut plain).map_err(failed)?;
        let byte_length = (plain.len() - offset) as u64;
        let whole =
            LevelIndex { byte_offset: offset as u64, byte_length, uncompressed_byte_length: byte_length };
        plain[Header::LENGTH..][..LevelIndex::LENGTH].copy_from_slice(&whole.as_bytes());
        plain[SCHEME..SCHEME + 4].fill(0);
    }
    Ok(plain)
}

fn damaged(why: &str) -> DecodeError {
    DecodeError::Damaged(why.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::{decode, dimensions};

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

    /// The transcoder alone would panic on both.
    #[test]
    fn sizes_of_blocks_and_lengths_of_keys_do_no_harm() {
        let description = u32::from_le_bytes(UASTC[48..52].try_into().unwrap()) as usize;
        let mut wide = UASTC.to_vec();
        wide[description + 16] = 255;
        let _ = decode(&wide);
        let keys = u32::from_le_bytes(UASTC[60..64].try_into().unwrap());
        let mut unpadded = UASTC.to_vec();
        unpadded[60..64].copy_from_slice(&(keys - 1).to_le_bytes());
        assert_eq!(decode(&unpadded), decode(UASTC));
    }

    /// A frame of Zstandard whose one block repeats a byte 131,072 times, more than the image has.
    #[test]
    fn no_more_is_unpacked_than_the_image_has() {
        let frame = [0x28, 0xb5, 0x2f, 0xfd, 0x00, 0x58, 0x03, 0x00, 0x10, 0x00];
        let mut packed = with(UASTC, 80, UASTC.len() as u64);
        packed[88..96].copy_from_slice(&(frame.len() as u64).to_le_bytes());
        packed.extend(frame);
        let plain = without_extras(&packed, &container(&packed).unwrap()).unwrap();
        assert_eq!(plain.len(), packed.len() + 3 * 2 * 16);
    }

    #[test]
    fn stated_lengths_take_no_memory_and_no_wrong_bit_panics() {
        // In the index of levels, which follows the header: the unpacked length, which nothing depends on, and the packed one.
        assert!(decode(&with(UASTC, 96, 1 << 50)).is_ok());
        assert!(matches!(decode(&with(UASTC, 88, 1 << 50)), Err(DecodeError::Damaged(_))));
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
