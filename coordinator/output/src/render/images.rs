//! The images of a file, as pictures hold them.

use std::collections::BTreeMap;

use kernel::picture::{Encoding, Image};

use document::LightmapLink;
use document::images::image_of;
use gltf::Material;
use scene::LitDocument;

/// The images in use.
pub(super) struct Images<'a> {
    document: &'a LitDocument,
    /// Place among the images in use, by index in the document and whether it is a page of a lightmap.
    places: BTreeMap<(usize, bool), u32>,
    /// What the pixels of lightmaps mean.
    of_lightmaps: Encoding,
    in_use: Vec<Image>,
}

impl<'a> Images<'a> {
    pub(super) fn new(document: &'a LitDocument, of_lightmaps: Encoding) -> Self {
        Self { document, places: BTreeMap::new(), of_lightmaps, in_use: vec![] }
    }

    /// The lightmap of a material.
    pub(super) fn lightmap(&self, material: &Material) -> Option<LightmapLink<'a>> {
        LightmapLink::of(&self.document.document, material)
    }

    /// The place of a texture's image among those in use; `None` where it cannot be had, as a warning says.
    pub(super) fn index(&mut self, texture: &gltf::Texture, is_lightmap: bool) -> Option<u32> {
        let index = image_of(texture)?;
        if let Some(known) = self.places.get(&(index, is_lightmap)) {
            return Some(*known);
        }
        let decoded = self.document.images.get(&index)?;
        let place = self.in_use.len() as u32;
        self.in_use.push(Image {
            width: decoded.width(),
            height: decoded.height(),
            encoding: if is_lightmap { self.of_lightmaps } else { Encoding::Srgb },
            pixels: decoded.texels().as_flattened().to_vec().into(),
        });
        self.places.insert((index, is_lightmap), place);
        Some(place)
    }

    /// The images in use.
    pub(super) fn finish(self) -> Vec<Image> {
        self.in_use
    }
}
