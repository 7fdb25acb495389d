//! Materials of KHR_materials_transmission, as viewers and pictures show them that know alpha alone.

use gltf::json::Material;
use gltf::json::material::AlphaMode;
use gltf::json::validation::Checked;

/// Least part of the light that glass stops, where it may glow: what is not there at all would not be seen to.
pub const LEAST_OF_GLASS: f64 = 1.0 / 1024.0;

/// A transmitting material as one of alpha.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glass {
    /// Its alpha: the part of the light that does not pass.
    pub alpha: f32,
    /// Part of the base colour that is seen of what is opaque.
    pub diffuse: f32,
    /// Multiplies emission, which alpha would dim.
    pub glow: f32,
}

impl Glass {
    /// The glass that a material is; `None` where it is none, or where one number does not say it: with a texture, or holes. Colours
    /// of vertices would have to be white.
    #[must_use]
    pub fn of(material: &Material) -> Option<Self> {
        let extensions = material.extensions.as_ref()?;
        let transmission = extensions.transmission.as_ref()?;
        let pbr = &material.pbr_metallic_roughness;
        let (metal, factor) = (pbr.metallic_factor.0, transmission.transmission_factor.0);
        let has_one_number = extensions.unlit.is_none()
            && extensions.pbr_specular_glossiness.is_none()
            && transmission.transmission_texture.is_none()
            && pbr.base_color_texture.is_none()
            && (metal == 0.0 || pbr.metallic_roughness_texture.is_none());
        let there = match material.alpha_mode {
            Checked::Valid(AlphaMode::Opaque) => 1.0,
            Checked::Valid(AlphaMode::Blend) => pbr.base_color_factor.0[3].clamp(0.0, 1.0),
            _ => return None,
        };
        if !has_one_number || !(0.0..=1.0).contains(&factor) || factor == 0.0 {
            return None;
        }
        let [red, green, blue, _] = pbr.base_color_factor.0.map(|value| value.clamp(0.0, 1.0));
        let passing = factor * (1.0 - metal.clamp(0.0, 1.0)) * (red + green + blue) / 3.0;
        let opacity = (1.0 - passing).max(LEAST_OF_GLASS as f32);
        Some(Self { alpha: there * opacity, diffuse: (1.0 - factor) / opacity, glow: opacity.recip() })
    }
}
