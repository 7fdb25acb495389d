//! Materials of pictures.

use gltf::material::AlphaMode;
use gltf::texture::Info;
use gltf::{Document, Material};
use kernel::picture::{Alpha, Encoding, Texture, Wrap};

use super::images::Images;
use document::texture::{self, Filter, Mapping};
use document::{Glass, LightmapLink, MOZ_LIGHTMAP};

/// glTF's cutoff where a file states none.
const DEFAULT_CUTOFF: f32 = 0.5;

/// A material as pictures show it.
#[derive(Debug, Clone)]
pub(super) struct Appearance {
    /// Base colour and opacity.
    pub(super) base: [f32; 4],
    pub(super) base_texture: Option<Mapped>,
    /// The part of base colour that reflects diffusely: 1 - metallic factor, or the largest specular one. Where a texture says what
    /// is metal, or nothing says what the material is, it is 1, as the exporter has it.
    pub(super) diffuse: f32,
    /// Emitted radiance.
    pub(super) emission: [f32; 3],
    pub(super) emission_texture: Option<Mapped>,
    pub(super) alpha: Alpha,
    pub(super) double_sided: bool,
    /// Whether its light is in a lightmap,
    pub(super) names_lightmap: bool,
    /// which is this, where it can be had, with the irradiance that 1 stands for.
    pub(super) lightmap: Option<(Mapped, f32)>,
    /// Viewers show its colours as they are.
    pub(super) unlit: bool,
}

/// A texture and how its coordinates are found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mapped {
    pub(super) texture: Texture,
    pub(super) mapping: Mapping,
}

impl Appearance {
    /// The material of those that have none.
    pub(super) fn default_material() -> Self {
        Self {
            base: [1.0; 4],
            base_texture: None,
            diffuse: 1.0,
            emission: [0.0; 3],
            emission_texture: None,
            alpha: Alpha::Opaque,
            double_sided: false,
            names_lightmap: false,
            lightmap: None,
            unlit: false,
        }
    }

    /// What a material of a document looks like. Pages of lightmaps have this encoding.
    pub(super) fn new(
        document: &Document,
        material: &Material,
        images: &mut Images,
        of_lightmaps: Encoding,
    ) -> Self {
        let unlit = material.unlit();
        let surface = material.pbr_metallic_roughness();
        let glossy = material.pbr_specular_glossiness().filter(|_| !unlit);
        let (base, base_texture) = match &glossy {
            Some(glossy) => (glossy.diffuse_factor(), glossy.diffuse_texture()),
            None => (surface.base_color_factor(), surface.base_color_texture()),
        };
        let base = base.map(positive);
        // The exporter gives those without a material a default one.
        let is_default = material.name().is_none()
            && glossy.is_none()
            && base == [1.0; 4]
            && (surface.metallic_factor(), surface.roughness_factor()) == (1.0, 1.0)
            && base_texture.is_none();
        let (specular, is_textured) = match &glossy {
            Some(glossy) => {
                let largest = glossy.specular_factor().into_iter().fold(0.0, f32::max);
                (largest, glossy.specular_glossiness_texture().is_some())
            }
            None => (surface.metallic_factor(), surface.metallic_roughness_texture().is_some()),
        };
        let diffuse = if is_default || is_textured { 1.0 } else { 1.0 - part(specular) };
        let glass = material.index().and_then(|index| Glass::of(document.as_json().materials.get(index)?));
        let [red, green, blue, alpha] = base;
        let base = [red, green, blue, glass.map_or(alpha, |glass| glass.alpha)];
        let diffuse = diffuse * glass.map_or(1.0, |glass| glass.diffuse);
        let strength = positive(material.emissive_strength().unwrap_or(1.0));
        let emission = material.emissive_factor().map(|value| positive(positive(value) * strength));
        let emission = emission.map(|value| positive(value * glass.map_or(1.0, |glass| glass.glow)));
        let mut mapped = |texture: &gltf::Texture, mapping: Mapping, encoding: Encoding| {
            let image = images.index(texture, encoding)?;
            let wrap = |wrap| match wrap {
                texture::Wrap::Repeat => Wrap::Repeat,
                texture::Wrap::Mirror => Wrap::Mirror,
                texture::Wrap::Clamp => Wrap::Clamp,
            };
            let sampler = mapping.sampler;
            let nearest = sampler.filter == Filter::Nearest;
            let texture = Texture { image, wrap: [wrap(sampler.wrap_u), wrap(sampler.wrap_v)], nearest };
            Some(Mapped { texture, mapping })
        };
        let lightmap = LightmapLink::of(document, material)
            .and_then(|link| Some((mapped(&link.texture, link.mapping, of_lightmaps)?, link.intensity)));
        let mut of_material = |info: Info| mapped(&info.texture(), Mapping::new(&info), Encoding::Srgb);
        let base_texture = base_texture.and_then(&mut of_material);
        // An unlit material shows no emission, and black cannot be textured.
        let shines = !unlit && emission != [0.0; 3];
        let emission_texture = material.emissive_texture().filter(|_| shines).and_then(of_material);
        Self {
            base,
            base_texture,
            diffuse,
            emission: if shines { emission } else { [0.0; 3] },
            emission_texture,
            alpha: match material.alpha_mode() {
                _ if glass.is_some() => Alpha::Blend,
                AlphaMode::Opaque => Alpha::Opaque,
                AlphaMode::Mask => Alpha::Mask(positive(material.alpha_cutoff().unwrap_or(DEFAULT_CUTOFF))),
                AlphaMode::Blend => Alpha::Blend,
            },
            double_sided: material.double_sided(),
            names_lightmap: material.extension_value(MOZ_LIGHTMAP).is_some(),
            lightmap,
            unlit,
        }
    }
}

/// A factor that can be: what is negative, infinite or no number is none.
fn positive(value: f32) -> f32 {
    if value.is_finite() { value.max(0.0) } else { 0.0 }
}

fn part(value: f32) -> f32 {
    positive(value).min(1.0)
}
