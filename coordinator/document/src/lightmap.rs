//! MOZ_lightmap: the light of a material in an image.

use gltf::{Document, Material};
use serde_json::Value;

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
    /// The lightmap that a material names; `None` where there is no such texture, or its intensity is none.
    #[must_use]
    pub fn of(document: &'a Document, material: &Material) -> Option<Self> {
        let link = material.extension_value(MOZ_LIGHTMAP)?;
        let info: gltf::json::texture::Info = serde_json::from_value(link.clone()).ok()?;
        let texture = document.textures().nth(info.index.value())?;
        let intensity = link.get("intensity").map_or(Some(1.0), Value::as_f64)? as f32;
        let mapping = Mapping::of_info(&texture, &info);
        (intensity.is_finite() && intensity >= 0.0).then_some(Self { texture, mapping, intensity })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;
    use gltf::Gltf;
    use serde_json::json;

    use super::*;

    /// Set, place of (1, 1) on the page and intensity of a material with this link.
    fn linked(link: Value) -> Option<(u32, DVec2, f32)> {
        let file = json!({
            "asset": { "version": "2.0" },
            "images": [{ "uri": "page.png" }],
            "textures": [{ "source": 0 }],
            "materials": [{ "extensions": { "MOZ_lightmap": link } }],
        });
        let document = Gltf::from_slice_without_validation(file.to_string().as_bytes()).unwrap().document;
        let material = document.materials().next().unwrap();
        let LightmapLink { mapping, intensity, .. } = LightmapLink::of(&document, &material)?;
        Some((mapping.set, mapping.transform.transform_point2(DVec2::ONE), intensity))
    }

    #[test]
    fn a_link_has_a_page_a_place_and_an_intensity() {
        assert_eq!(linked(json!({ "index": 0 })), Some((0, DVec2::ONE, 1.0)));
        let link = |transform| {
            let extensions = json!({ "KHR_texture_transform": transform });
            json!({ "index": 0, "texCoord": 2, "intensity": 2.5, "extensions": extensions })
        };
        let moved = json!({ "offset": [0.25, 0.5], "scale": [0.5, -1.0] });
        assert_eq!(linked(link(moved)), Some((2, DVec2::new(0.75, -0.5), 2.5)));
        assert_eq!(linked(link(json!({ "texCoord": 3 }))), Some((3, DVec2::ONE, 2.5)));
    }

    #[test]
    fn a_link_to_nothing_is_none() {
        assert_eq!(linked(json!({ "index": 1 })), None);
        assert_eq!(linked(json!({ "texCoord": 1 })), None);
        for intensity in [json!(-1.0), json!(1e39), json!("bright"), Value::Null] {
            assert_eq!(linked(json!({ "index": 0, "intensity": intensity })), None, "{intensity}");
        }
    }
}
