//! The images of a file, as pictures hold them.

use std::collections::BTreeMap;

use kernel::picture::{Encoding, Image};

use document::images::image_of;
use scene::LitDocument;

/// The images in use.
pub(super) struct Images<'a> {
    document: &'a LitDocument,
    /// Place among the images in use, by index in the document and what their pixels mean.
    places: BTreeMap<(usize, Encoding), u32>,
    in_use: Vec<Image>,
}

impl<'a> Images<'a> {
    pub(super) fn new(document: &'a LitDocument) -> Self {
        Self { document, places: BTreeMap::new(), in_use: vec![] }
    }

    /// The place of a texture's image among those in use; `None` where it cannot be had, as a warning says.
    pub(super) fn index(&mut self, texture: &gltf::Texture, encoding: Encoding) -> Option<u32> {
        let index = image_of(texture)?;
        if let Some(known) = self.places.get(&(index, encoding)) {
            return Some(*known);
        }
        let decoded = self.document.images.get(&index)?;
        let place = self.in_use.len() as u32;
        self.in_use.push(Image {
            width: decoded.width(),
            height: decoded.height(),
            encoding,
            pixels: decoded.texels().as_flattened().to_vec().into(),
        });
        self.places.insert((index, encoding), place);
        Some(place)
    }

    /// The images in use.
    pub(super) fn finish(self) -> Vec<Image> {
        self.in_use
    }
}
