//! MOZ_lightmap: the light of a material in an image.

use gltf::{Document, Material};

use crate::texture::Mapping;

/// The extension by which a material names its lightmap.
pub const MOZ_LIGHTMAP: &str = "MOZ_lightmap";

/// The lightmap of a material.
pub struct LightmapLink<'a> {
    /// Its page.
    pub texture: gltf::Texture<'a>,
    /// Where vertices lie on the page.
    pub mapping: Mapping,
    /// Irradiance that 1 stands for in the page.
    pub intensity: f32,
}

impl<'a> LightmapLink<'a> {
    /// The lightmap that a material names, if there is such a texture.
    #[must_use]
    pub fn of(document: &'a Document, material: &Material) -> Option<Self> {
        let link = material.extension_value(MOZ_LIGHTMAP)?;
        let info: gltf::json::texture::Info = serde_json::from_value(link.clone()).ok()?;
        let texture = document.textures().nth(info.index.value())?;
        let intensity = link.get("intensity").map_or(Some(1.0), serde_json::Value::as_f64)? as f32;
        let mapping = Mapping::of_info(&texture, &info);
        (intensity.is_finite() && intensity >= 0.0).then_some(Self { texture, mapping, intensity })
    }
}
