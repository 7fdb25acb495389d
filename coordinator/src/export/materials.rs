//! Materials that show the light.

use std::collections::HashMap;

use gltf::json::extensions::material::Unlit;
use gltf::json::{Index, Material, Root};

/// Makes the lit counterparts of the document's materials, each once, and adds them to the document.
#[derive(Debug, Default)]
pub(super) struct LitMaterials {
    made: HashMap<(Option<usize>, bool), Index<Material>>,
}

impl LitMaterials {
    /// The material that shows the light on a primitive of this material.
    ///
    /// A primitive without one gets a white one: glTF's default material is a white metal, whose own grey no viewer
    /// shows either. `one_side` says that the primitive is one side of a `doubleSided` one.
    pub(super) fn lit(
        &mut self,
        root: &mut Root,
        material: Option<Index<Material>>,
        one_side: bool,
    ) -> Index<Material> {
        *self.made.entry((material.map(|index| index.value()), one_side)).or_insert_with(|| {
            let mut lit = material.and_then(|index| root.get(index)).cloned().unwrap_or_default();
            if one_side {
                lit.double_sided = false;
            }
            if !is_emissive(&lit) {
                let extensions = lit.extensions.get_or_insert_default();
                extensions.unlit = Some(Unlit {});
                extensions.emissive_strength = None;
            }
            root.push(lit)
        })
    }

    /// Whether the document's material has a lit counterpart.
    pub(super) fn replaces(&self, material: usize) -> bool {
        [false, true].iter().any(|&one_side| self.made.contains_key(&(Some(material), one_side)))
    }
}

/// Says in every texture transform which texture coordinates it means.
///
/// The `gltf` crate writes one that does not as `null`, which the format does not allow.
pub(super) fn complete_texture_transforms(root: &mut Root) {
    for material in &mut root.materials {
        let pbr = &mut material.pbr_metallic_roughness;
        let textures = [
            &mut pbr.base_color_texture,
            &mut pbr.metallic_roughness_texture,
            &mut material.emissive_texture,
        ];
        for texture in textures.into_iter().flatten() {
            let extensions = texture.extensions.as_mut();
            if let Some(transform) = extensions.and_then(|extensions| extensions.texture_transform.as_mut()) {
                transform.tex_coord.get_or_insert(texture.tex_coord);
            }
        }
    }
}

fn is_emissive(material: &Material) -> bool {
    material.emissive_factor.0.iter().any(|&channel| channel > 0.0)
}
