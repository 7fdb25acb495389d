//! Images of the materials in use, decoded in parallel, each once. One that cannot be read is a warning, not an error.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use gltf::json;
use rayon::prelude::*;

use crate::PlainDocument;
use crate::buffers::read_uri;
use crate::texture::{self, Image};

/// Most bytes of the texels of all images together. Sums for means over polygons take half as much again.
const MOST_BYTES: u64 = 2 << 30;

/// Most bytes of texels per byte that a file may have, so that small files cannot unfold to large images.
const BYTES_PER_FILE_BYTE: u64 = 64;

/// Decoded images by their index.
pub type Images = BTreeMap<usize, Arc<Image>>;

/// Extensions that give a texture an image of a format beside those of the specification, the one that counts first.
pub(crate) const IMAGE_EXTENSIONS: [&str; 2] = ["EXT_texture_webp", "KHR_texture_basisu"];

/// Index of a texture's image: that of an extension if it has one, else its own.
pub fn image_of(texture: &gltf::Texture) -> Option<usize> {
    let of_extension = |name: &&str| texture.extension_value(name)?.get("source")?.as_u64();
    let index = IMAGE_EXTENSIONS.iter().find_map(of_extension).map(|index| index as usize);
    index.or_else(|| texture.source().map(|image| image.index()))
}

/// Decodes these images; those that cannot be decoded become warnings.
pub fn decode(file: &PlainDocument, needed: &BTreeSet<usize>, warnings: &mut Vec<String>) -> Images {
    let images = &file.document.as_json().images;
    let mut budget = file.bytes_left;
    let most = MOST_BYTES.min(file.max_bytes.saturating_mul(BYTES_PER_FILE_BYTE));
    let mut room = most;
    let mut refused = |index: usize, why: String| {
        let name = images.get(index).and_then(|image| image.name.as_deref()).unwrap_or_default();
        let label = if name.is_empty() { format!("image {index}") } else { format!("image \"{name}\"") };
        warnings.push(format!("{label} is not read: {why}; the factors alone count where it is used"));
    };
    let mut encoded: Vec<(usize, Cow<[u8]>)> = vec![];
    for &index in needed {
        let bytes = match images.get(index) {
            Some(image) => bytes(file, image, &mut budget),
            None => Err("there is no such image in the file".to_owned()),
        };
        let whole = bytes.and_then(|bytes| {
            let (width, height) = texture::dimensions(&bytes).map_err(|error| error.to_string())?;
            let taken = u64::from(width) * u64::from(height) * 4;
            room = room.checked_sub(taken).ok_or_else(|| {
                format!("all images together have more than {} MiB of texels; scale them down", most >> 20)
            })?;
            Ok(bytes)
        });
        match whole {
            Ok(bytes) => encoded.push((index, bytes)),
            Err(why) => refused(index, why),
        }
    }
    let decoded: Vec<_> =
        encoded.into_par_iter().map(|(index, bytes)| (index, texture::decode(&bytes))).collect();
    let mut found = Images::new();
    for (index, image) in decoded {
        match image {
            Ok(image) => {
                found.insert(index, Arc::new(image));
            }
            Err(error) => refused(index, error.to_string()),
        }
    }
    found
}

/// The encoded bytes of an image; those of a file beside the document come out of `budget`.
fn bytes<'a>(
    file: &'a PlainDocument,
    image: &json::Image,
    budget: &mut u64,
) -> Result<Cow<'a, [u8]>, String> {
    if let Some(view) = image.buffer_view {
        let outside = || "its buffer view reaches outside its buffer".to_owned();
        let view = file.document.as_json().buffer_views.get(view.value()).ok_or_else(outside)?;
        let start = view.byte_offset.map_or(0, |offset| offset.0);
        let end = start.checked_add(view.byte_length.0).ok_or_else(outside)?;
        let range = usize::try_from(start).ok().zip(usize::try_from(end).ok()).ok_or_else(outside)?;
        let buffer = file.buffers.get(view.buffer.value()).ok_or_else(outside)?;
        return buffer.get(range.0..range.1).map(Cow::Borrowed).ok_or_else(outside);
    }
    let uri = image.uri.as_deref().ok_or_else(|| "it has neither a buffer view nor a uri".to_owned())?;
    let bytes = read_uri(uri, file.folder.as_ref(), *budget)?;
    if !uri.starts_with("data:") {
        *budget -= bytes.len() as u64;
    }
    Ok(Cow::Owned(bytes))
}
