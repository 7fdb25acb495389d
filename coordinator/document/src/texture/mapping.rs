//! From a vertex's texture coordinates to places on an image.

use glam::{DAffine2, DMat2, DVec2};
use gltf::Document;
use gltf::texture::Info;

use super::Sampler;
use crate::error::ImportProblem;
use crate::labels::material_label;

/// The texture coordinates of a texture, their transform, and its sampler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mapping {
    /// The set: n of TEXCOORD_n.
    pub set: u32,
    /// KHR_texture_transform: from the file's coordinates to those on the image.
    pub transform: DAffine2,
    /// Wrapping and filtering.
    pub sampler: Sampler,
}

impl Mapping {
    /// The mapping of a texture of a material.
    #[must_use]
    pub fn new(info: &Info) -> Self {
        let own = info.texture_transform();
        let transform = own.map(|own| (own.tex_coord(), affine(own.offset(), own.rotation(), own.scale())));
        Self::of(&info.texture(), info.tex_coord(), transform)
    }

    /// The mapping of a texture that an extension names, as materials name theirs.
    #[must_use]
    pub fn of_info(texture: &gltf::Texture, info: &gltf::json::texture::Info) -> Self {
        let own = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.as_ref());
        let transform = own.map(|own| (own.tex_coord, affine(own.offset.0, own.rotation.0, own.scale.0)));
        Self::of(texture, info.tex_coord, transform)
    }

    /// The mapping of a texture with this set, unless the transform names another.
    fn of(texture: &gltf::Texture, set: u32, transform: Option<(Option<u32>, DAffine2)>) -> Self {
        let (named, transform) = transform.unwrap_or((None, DAffine2::IDENTITY));
        Self { set: named.unwrap_or(set), transform, sampler: Sampler::new(&texture.sampler()) }
    }
}

/// Checks that those transforms are finite which are read and written again: JSON has numbers that are too large.
pub(crate) fn check_transforms(document: &Document) -> Result<(), ImportProblem> {
    for material in document.materials() {
        let base = material.pbr_metallic_roughness();
        let other = material.pbr_specular_glossiness();
        let specular = material.specular();
        let infos = [
            base.base_color_texture(),
            base.metallic_roughness_texture(),
            material.emissive_texture(),
            other.as_ref().and_then(|other| other.diffuse_texture()),
            other.as_ref().and_then(|other| other.specular_glossiness_texture()),
            specular.as_ref().and_then(|specular| specular.specular_texture()),
            specular.as_ref().and_then(|specular| specular.specular_color_texture()),
        ];
        for transform in infos.into_iter().flatten().filter_map(|info| info.texture_transform()) {
            let named = [("offset", transform.offset()), ("scale", transform.scale())];
            let numbers = named.into_iter().flat_map(|(name, pair)| pair.map(|value| (name, value)));
            let mut numbers = numbers.chain([("rotation", transform.rotation())]);
            if let Some((factor, value)) = numbers.find(|(_, value)| !value.is_finite()) {
                let place = format!("a texture of {}", material_label(&material));
                return Err(ImportProblem::Factor { place, factor, value, expected: "finite" });
            }
        }
    }
    Ok(())
}

/// First scaled, then rotated, then moved. A positive rotation turns coordinates counter-clockwise as one looks at the image, whose v
/// points down: so the extension's words say, and the viewers of Khronos and three.js do it.
fn affine(offset: [f32; 2], rotation: f32, scale: [f32; 2]) -> DAffine2 {
    let [offset, scale] = [offset, scale].map(|pair| DVec2::from_array(pair.map(f64::from)));
    let (sine, cosine) = (libm::sin(f64::from(rotation)), libm::cos(f64::from(rotation)));
    let rotation = DMat2::from_cols(DVec2::new(cosine, -sine), DVec2::new(sine, cosine));
    DAffine2::from_mat2_translation(rotation * DMat2::from_diagonal(scale), offset)
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn scale_comes_first_then_rotation_then_offset() {
        let transform = affine([10.0, 20.0], FRAC_PI_2, [2.0, 3.0]);
        // u, to the right, turns up, against v.
        let turned = transform.transform_point2(DVec2::X);
        assert!(turned.distance(DVec2::new(10.0, 18.0)) < 1e-6, "{turned}");
        let turned = transform.transform_point2(DVec2::Y);
        assert!(turned.distance(DVec2::new(13.0, 20.0)) < 1e-6, "{turned}");
        assert_eq!(affine([0.5, 0.25], 0.0, [1.0, 1.0]), DAffine2::from_translation(DVec2::new(0.5, 0.25)));
    }
}
