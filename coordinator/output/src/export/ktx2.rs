//! Images of half floats as KTX2 with blocks of BC6H, a byte to a texel, which graphics hardware reads as they are.

use block_compression::encode::compress_rgba16;
use block_compression::{BC6HSettings, CompressionVariant};
use half::f16;
use ktx2::dfd::{Basic, Block};
use ktx2::{Format, Header, Index, LevelIndex};
use rayon::prelude::*;

use super::ExportError;
use super::pages::half;

/// Edge of a block, in texels.
const BLOCK: usize = 4;

/// Bytes of a block, to which the image's place in the file is aligned.
const BLOCK_BYTES: usize = 16;

/// One pair of end points for each block: .06 s for a million texels, with a relative error of .3 to .5 % on lightmaps. The best
/// choice of the encoder takes 7 s for .2 to .4 %.
const FORMAT: CompressionVariant = CompressionVariant::BC6H(BC6HSettings::very_fast());

/// Images of one size, each from the top row down, as the layers of one KTX2 file; one without a name is no layer. The names are kept as
/// `halflight.layers`.
pub(super) fn ktx2(layers: &[(Option<&str>, &[[f32; 3]])], size: [u32; 2]) -> Result<Vec<u8>, ExportError> {
    let failed = |error: &dyn std::fmt::Debug| ExportError::Image(format!("KTX2: {error:?}"));
    let (format, type_size) =
        Basic::from_format(Format::BC6H_UFLOAT_BLOCK).map_err(|error| failed(&error))?;
    let format = Block::Basic(format).to_vec();
    let names: Vec<&str> = layers.iter().filter_map(|(name, _)| *name).collect();
    let all_names = names.join("\n");
    // In the order of their keys.
    let mut entries = vec![("KTXorientation", "rd"), ("KTXwriter", "Halflight")];
    if !names.is_empty() {
        entries.push(("halflight.layers", &all_names));
    }
    let entries: Vec<u8> = entries.into_iter().flat_map(|(key, value)| entry(key, value)).collect();
    let data: Vec<u8> = layers.iter().flat_map(|(_, image)| blocks(image, size)).collect();

    let format_start = Header::LENGTH + LevelIndex::LENGTH;
    // Its length comes first.
    let format_length = format.len() + size_of::<u32>();
    let entries_start = format_start + format_length;
    let data_start = (entries_start + entries.len()).next_multiple_of(BLOCK_BYTES);
    let short = |length: usize| u32::try_from(length).map_err(|error| failed(&error));
    let header = Header {
        format: Some(Format::BC6H_UFLOAT_BLOCK),
        type_size,
        pixel_width: size[0],
        pixel_height: size[1],
        pixel_depth: 0,
        layer_count: short(names.len())?,
        face_count: 1,
        level_count: 1,
        supercompression_scheme: None,
        index: Index {
            dfd_byte_offset: short(format_start)?,
            dfd_byte_length: short(format_length)?,
            kvd_byte_offset: short(entries_start)?,
            kvd_byte_length: short(entries.len())?,
            sgd_byte_offset: 0,
            sgd_byte_length: 0,
        },
    };
    let length = data.len() as u64;
    let level =
        LevelIndex { byte_offset: data_start as u64, byte_length: length, uncompressed_byte_length: length };
    let mut file =
        [&header.as_bytes()[..], &level.as_bytes(), &short(format_length)?.to_le_bytes(), &format].concat();
    file.extend(entries);
    file.resize(data_start, 0);
    file.extend(data);
    Ok(file)
}

/// A text as KTX2 keeps it with a file: length, key and value, each text ended by 0, padded to four bytes.
fn entry(key: &str, value: &str) -> Vec<u8> {
    let text = [key.as_bytes(), &[0], value.as_bytes(), &[0]].concat();
    let mut entry = [&(text.len() as u32).to_le_bytes()[..], &text].concat();
    entry.resize(entry.len().next_multiple_of(4), 0);
    entry
}

/// An image as blocks, row by row. Where it ends within a block, its last texels are repeated.
fn blocks(image: &[[f32; 3]], [width, height]: [u32; 2]) -> Vec<u8> {
    let (width, height) = (width as usize, height as usize);
    let padded = width.next_multiple_of(BLOCK);
    let of_row = |row: usize| {
        let mut texels = Vec::with_capacity(padded * BLOCK * 4);
        for line in row * BLOCK..(row + 1) * BLOCK {
            let line = &image[line.min(height - 1) * width..][..width];
            for column in 0..padded {
                let [red, green, blue] = line[column.min(width - 1)].map(half);
                texels.extend([red, green, blue, f16::ONE]);
            }
        }
        let (width, height) = (padded as u32, BLOCK as u32);
        let mut blocks = vec![0; FORMAT.blocks_byte_size(width, height)];
        compress_rgba16(FORMAT, &texels, &mut blocks, width, height, 4 * width);
        blocks
    };
    (0..height.div_ceil(BLOCK)).into_par_iter().flat_map_iter(of_row).collect()
}

#[cfg(test)]
mod tests {
    use ktx2::Reader;

    use super::*;

    /// The texels of the layers of a file, decoded by another program.
    fn decoded(file: &[u8], [width, height]: [usize; 2]) -> Vec<Vec<[f32; 3]>> {
        let reader = Reader::new(file).unwrap();
        let level = reader.levels().next().unwrap();
        let across = width.div_ceil(BLOCK);
        let of_layer = |blocks: &[u8]| {
            let mut image = vec![[0.0; 3]; width * height];
            for (index, block) in blocks.chunks_exact(BLOCK_BYTES).enumerate() {
                let mut texels = [0.0_f32; BLOCK * BLOCK * 3];
                bcdec_rs::bc6h_float(block, &mut texels, BLOCK * 3, false);
                for (place, texel) in texels.as_chunks::<3>().0.iter().enumerate() {
                    let (x, y) =
                        (index % across * BLOCK + place % BLOCK, index / across * BLOCK + place / BLOCK);
                    if x < width && y < height {
                        image[y * width + x] = *texel;
                    }
                }
            }
            image
        };
        level.data.chunks_exact(across * height.div_ceil(BLOCK) * BLOCK_BYTES).map(of_layer).collect()
    }

    #[test]
    fn what_is_read_is_what_was_written_within_a_twentieth() {
        // Neither edge ends with a block.
        let [width, height] = [30, 21];
        let light =
            |x: usize, y: usize| 100.0 / (1.0 + (x as f32 / 20.0).powi(2) + (y as f32 / 15.0).powi(2));
        let image = |scale: f32| -> Vec<[f32; 3]> {
            let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
            texels.map(|(x, y)| [1.0, 0.8, 0.3].map(|colour| scale * colour * light(x, y))).collect()
        };
        let (bright, dark) = (image(1.0), image(0.001));
        let file = ktx2(&[(Some("lightmap"), &bright), (Some("day"), &dark)], [width as u32, height as u32])
            .unwrap();
        let header = Reader::new(&file).unwrap().header();
        assert_eq!((header.pixel_width, header.pixel_height, header.layer_count), (30, 21, 2));
        for (layer, image) in decoded(&file, [width, height]).iter().zip([bright, dark]) {
            for (found, given) in layer.iter().flatten().zip(image.iter().flatten()) {
                assert!((found / given - 1.0).abs() < 0.05, "{found} for {given}");
            }
        }
    }

    #[test]
    fn layers_have_names_and_one_image_alone_is_none() {
        let image = [[0.5, -1.0, 1e9]; 4];
        let keys = |file: &[u8]| -> Vec<(String, Vec<u8>)> {
            let reader = Reader::new(file).unwrap();
            reader.key_value_data().map(|(key, value)| (key.to_owned(), value.to_vec())).collect()
        };
        let alone = ktx2(&[(None, &image)], [2, 2]).unwrap();
        assert_eq!(Reader::new(&alone).unwrap().header().layer_count, 0);
        assert_eq!(keys(&alone)[0], ("KTXorientation".into(), b"rd\0".to_vec()));
        let [red, green, blue] = decoded(&alone, [2, 2])[0][3];
        assert!((red - 0.5).abs() < 0.01 && green == 0.0 && blue > 6e4, "{red} {green} {blue}");
        let both = ktx2(&[(Some("lightmap"), &image), (Some("day"), &image)], [2, 2]).unwrap();
        assert_eq!(keys(&both)[2], ("halflight.layers".into(), b"lightmap\nday\0".to_vec()));
    }
}
