use std::collections::BTreeMap;

use glam::DVec3;
use gltf::json::Root;
use gltf::json::extensions::material::{EmissiveStrength, EmissiveStrengthFactor};

use super::NewLight;
use crate::stages::Origin;
use scene::{EXT_LIGHTS_IMAGE_BASED, colour_and_rest};
use scene::{LightEntry, Scene};

/// Factors of all users of one object of the document.
type Factors<T> = BTreeMap<T, Vec<DVec3>>;

/// The scene with its lights changed, and warnings of what the output cannot show.
///
/// Emissive materials and lights are changed in the document as well where all their users change alike. Otherwise the
/// document keeps them as they were; the light on other surfaces is right all the same.
pub(super) fn changed(scene: &Scene, light: &NewLight) -> (Scene, Vec<String>) {
    let mut changed = scene.clone();
    changed.sky = light.sky(scene.sky);
    let (mut of_materials, mut of_lights) = (Factors::new(), Factors::new());
    for (index, surface) in changed.surfaces.iter_mut().enumerate() {
        if surface.exitance == DVec3::ZERO {
            continue;
        }
        let factor = light.factor_of(scene, Origin::Surface(index));
        surface.exitance *= factor;
        if let Some(material) = material_of(scene, index) {
            of_materials.entry(material).or_default().push(factor);
        }
    }
    for (index, own) in changed.lights.iter_mut().enumerate() {
        let factor = light.factor_of(scene, Origin::Light(index));
        own.intensity *= factor;
        of_lights.entry(own.entry).or_default().push(factor);
    }
    let mut warnings = vec![];
    let has_sky = scene.source.root.extensions_used.iter().any(|name| name == EXT_LIGHTS_IMAGE_BASED);
    if has_sky && changed.sky != scene.sky {
        warnings.push(format!("the sky of the file ({EXT_LIGHTS_IMAGE_BASED}) is written as it was"));
    }
    let root = &mut changed.source.root;
    change_all(of_materials, root, |index| format!("material {index}"), change_material, &mut warnings);
    change_all(of_lights, root, LightEntry::to_string, LightEntry::multiply, &mut warnings);
    (changed, warnings)
}

fn change_all<T>(
    factors: Factors<T>,
    root: &mut Root,
    name: impl Fn(&T) -> String,
    change: impl Fn(T, &mut Root, DVec3),
    warnings: &mut Vec<String>,
) {
    for (entry, factors) in factors {
        let Some((factor, rest)) = factors.split_first() else { continue };
        if rest.iter().any(|other| other != factor) {
            warnings.push(format!(
                "{} of the file is that of lights which change differently: it is written as it was",
                name(&entry)
            ));
        } else if *factor != DVec3::ONE {
            change(entry, root, *factor);
        }
    }
}

/// The material of a surface in the document.
fn material_of(scene: &Scene, surface: usize) -> Option<usize> {
    let surface = &scene.surfaces[surface];
    let root = &scene.source.root;
    let mesh = root.get(root.nodes.get(surface.node)?.mesh?)?;
    Some(mesh.primitives.get(surface.primitive)?.material?.value())
}

fn change_material(index: usize, root: &mut Root, factor: DVec3) {
    let Some(material) = root.materials.get_mut(index) else { return };
    let (colour, above) = colour_and_rest(material.emissive_factor.0, factor);
    material.emissive_factor.0 = colour;
    // The factor ends at 1, and what is above it is the strength.
    if above > 1.0 {
        let strength = &mut material.extensions.get_or_insert_default().emissive_strength;
        let before = strength.as_ref().map_or(1.0, |strength| strength.emissive_strength.0);
        let emissive_strength = EmissiveStrengthFactor(before * above);
        *strength = Some(EmissiveStrength { emissive_strength });
    }
}
