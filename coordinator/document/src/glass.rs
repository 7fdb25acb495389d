//! Materials of KHR_materials_transmission, as viewers and pictures show them that know alpha alone.

use gltf::json::Material;
use gltf::json::material::AlphaMode;
use gltf::json::validation::Checked;

/// A transmitting material as one of alpha.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glass {
    /// What its alpha is multiplied by: the part of the light that does not pass.
    pub opacity: f32,
    /// Part of the base colour that is seen of what is opaque.
    pub diffuse: f32,
}

impl Glass {
    /// The glass that a material is; `None` where it is none, or where one number does not say it: with a texture that tells where
    /// light passes or what is metal, one whose alpha would begin to count, or holes.
    #[must_use]
    pub fn of(material: &Material) -> Option<Self> {
        let extensions = material.extensions.as_ref()?;
        let transmission = extensions.transmission.as_ref()?;
        let pbr = &material.pbr_metallic_roughness;
        let (metal, factor) = (pbr.metallic_factor.0, transmission.transmission_factor.0);
        let has_one_number = extensions.unlit.is_none()
            && extensions.pbr_specular_glossiness.is_none()
            && transmission.transmission_texture.is_none()
            && (metal == 0.0 || pbr.metallic_roughness_texture.is_none())
            && match material.alpha_mode {
                Checked::Valid(AlphaMode::Opaque) => pbr.base_color_texture.is_none(),
                Checked::Valid(AlphaMode::Blend) => true,
                _ => false,
            };
        if !has_one_number || !(0.0..=1.0).contains(&factor) || factor == 0.0 {
            return None;
        }
        let [red, green, blue, _] = pbr.base_color_factor.0.map(|value| value.clamp(0.0, 1.0));
        let passing = factor * (1.0 - metal.clamp(0.0, 1.0)) * (red + green + blue) / 3.0;
        let opacity = 1.0 - passing;
        Some(Self { opacity, diffuse: if opacity > 0.0 { (1.0 - factor) / opacity } else { 0.0 } })
    }
}
