//! Materials that show the light.

use std::collections::BTreeMap;

use glam::DVec3;
use gltf::json::extensions::material::Unlit;
use gltf::json::material::{AlphaMode, PbrBaseColorFactor, StrengthFactor};
use gltf::json::validation::Checked;
use gltf::json::{Index, Material, Root, extensions as json_extensions};
use serde_json::{Map, Value};

use super::exposure::corners;
use super::{ExportError, extensions};
use bake::lit::{LitMesh, LitTriangle};
use document::Glass;
use scene::Surface;

/// Material of the input, whether for one side only, whether it glows, and whether it is shown as glass.
type Key = (Option<usize>, bool, bool, bool);

/// Makes the lit counterparts of the document's materials, each once, and adds them to the document.
#[derive(Debug, Default)]
pub(super) struct LitMaterials {
    made: BTreeMap<Key, Index<Material>>,
}

impl LitMaterials {
    /// The material that shows the light on a primitive of this material.
    ///
    /// A primitive without one gets a white one: glTF's default material is a white metal, whose own grey no viewer
    /// shows either. `one_side` says that the primitive is one side of a `doubleSided` one; `glows`
    /// that it must show its emission, `glass` how it is shown where it is glass.
    pub(super) fn lit(
        &mut self,
        root: &mut Root,
        material: Option<Index<Material>>,
        one_side: bool,
        glows: bool,
        glass: Option<Glass>,
    ) -> Result<Index<Material>, ExportError> {
        let key = (material.map(|index| index.value()), one_side, glows, glass.is_some());
        if let Some(&made) = self.made.get(&key) {
            return Ok(made);
        }
        let mut lit = material.and_then(|index| root.get(index)).cloned().unwrap_or_default();
        if one_side {
            lit.double_sided = false;
        }
        if !glows {
            make_unlit(&mut lit, glass)?;
        }
        let made = root.push(lit);
        self.made.insert(key, made);
        Ok(made)
    }

    /// The document's materials with a lit counterpart of each.
    pub(super) fn lit_counterparts(&self) -> impl Iterator<Item = (usize, Index<Material>)> + '_ {
        self.made.iter().filter_map(|((original, ..), lit)| Some(((*original)?, *lit)))
    }
}

/// Makes viewers show base colour x `COLOR_0` and nothing else.
///
/// An unlit material may have no other extension: what they say goes to `extras.halflight.extensions`.
fn make_unlit(material: &mut Material, glass: Option<Glass>) -> Result<(), ExportError> {
    let mut others = match serde_json::to_value(&material.extensions)? {
        Value::Object(extensions) => extensions,
        _ => Map::new(),
    };
    if others.remove("KHR_materials_unlit").is_some() {
        // Its own factor means nothing.
        material.pbr_metallic_roughness.metallic_factor = StrengthFactor(0.0);
    }
    let glossy = material.extensions.take().and_then(|extensions| extensions.pbr_specular_glossiness);
    if let Some(glossy) = glossy {
        let pbr = &mut material.pbr_metallic_roughness;
        pbr.base_color_factor = PbrBaseColorFactor(glossy.diffuse_factor.0);
        pbr.base_color_texture = glossy.diffuse_texture;
        pbr.metallic_factor = StrengthFactor(0.0);
        pbr.metallic_roughness_texture = None;
    }
    if let Some(glass) = glass {
        material.alpha_mode = Checked::Valid(AlphaMode::Blend);
        material.pbr_metallic_roughness.base_color_factor.0[3] = glass.alpha;
    }
    if !others.is_empty() {
        extensions::note(&mut material.extras, Map::from_iter([("extensions".to_owned(), others.into())]))?;
    }
    material.extensions =
        Some(json_extensions::material::Material { unlit: Some(Unlit {}), ..Default::default() });
    Ok(())
}

/// Says in every texture transform which texture coordinates it means.
///
/// The `gltf` crate writes one that does not as `null`, which the format does not allow.
pub(super) fn complete_texture_transforms(root: &mut Root) {
    for material in &mut root.materials {
        let pbr = &mut material.pbr_metallic_roughness;
        let mut textures = vec![
            &mut pbr.base_color_texture,
            &mut pbr.metallic_roughness_texture,
            &mut material.emissive_texture,
        ];
        if let Some(extensions) = &mut material.extensions {
            let glossy = extensions.pbr_specular_glossiness.iter_mut();
            textures
                .extend(glossy.flat_map(|it| [&mut it.diffuse_texture, &mut it.specular_glossiness_texture]));
            let specular = extensions.specular.iter_mut();
            textures
                .extend(specular.flat_map(|it| [&mut it.specular_texture, &mut it.specular_color_texture]));
            textures.extend(extensions.transmission.iter_mut().map(|it| &mut it.transmission_texture));
        }
        for texture in textures.into_iter().flatten() {
            let extensions = texture.extensions.as_mut();
            if let Some(transform) = extensions.and_then(|extensions| extensions.texture_transform.as_mut()) {
                transform.tex_coord.get_or_insert(texture.tex_coord);
            }
        }
    }
}

/// Whether a surface emits more than it reflects.
pub(super) fn glows(
    lit: &LitMesh,
    surface: &Surface,
    triangles: &[LitTriangle],
) -> Result<bool, ExportError> {
    let emitted = surface.exitance.element_sum();
    if emitted <= 0.0 {
        return Ok(false);
    }
    let (mut flux, mut area) = (DVec3::ZERO, 0.0);
    for triangle in triangles {
        let corners = corners(lit, triangle)?;
        let [a, b, c] = corners.map(|corner| corner.position);
        let part = (b - a).cross(c - a).length();
        flux += corners.iter().map(|corner| corner.irradiance).sum::<DVec3>() * (part / 3.0);
        area += part;
    }
    // Without an area there is no mean, and what emits glows.
    let dominated = emitted * area < (surface.reflectance * flux).element_sum();
    Ok(!dominated)
}

/// The part of a base colour that reflects diffusely, where one number says it; all of it where the input is unlit.
pub(super) fn diffuse_part(material: Option<&Material>, glows: bool, glass: Option<Glass>) -> f64 {
    let Some(material) = material.filter(|_| !glows) else { return 1.0 };
    let seen = glass.map_or(1.0, |glass| f64::from(glass.diffuse));
    let pbr = &material.pbr_metallic_roughness;
    let extensions = material.extensions.as_ref();
    let has_no_metal = extensions
        .is_some_and(|extensions| extensions.pbr_specular_glossiness.is_some() || extensions.unlit.is_some());
    if has_no_metal || pbr.metallic_roughness_texture.is_some() {
        return seen;
    }
    seen * (1.0 - f64::from(pbr.metallic_factor.0))
}
