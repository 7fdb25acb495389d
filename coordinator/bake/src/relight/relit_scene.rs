use std::collections::BTreeMap;

use glam::DVec3;
use gltf::json::Root;
use gltf::json::extensions::material::{EmissiveStrength, EmissiveStrengthFactor};

use super::NewLight;
use crate::stages::Origin;
use scene::Scene;

/// Factors of all users of an object of the document, by its index.
type Factors = BTreeMap<usize, Vec<DVec3>>;

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
        if let Some(punctual) = punctual_of(scene, index) {
            of_lights.entry(punctual).or_default().push(factor);
        }
    }
    let mut warnings = vec![];
    let root = &mut changed.source.root;
    change_all(of_materials, "material", root, change_material, &mut warnings);
    change_all(of_lights, "light", root, change_punctual, &mut warnings);
    (changed, warnings)
}

fn change_all(
    factors: Factors,
    kind: &str,
    root: &mut Root,
    change: impl Fn(&mut Root, usize, DVec3),
    warnings: &mut Vec<String>,
) {
    for (index, factors) in factors {
        let Some((factor, rest)) = factors.split_first() else { continue };
        if rest.iter().any(|other| other != factor) {
            warnings.push(format!(
                "{kind} {index} of the file is that of lights which change differently: it is written as it was"
            ));
        } else if *factor != DVec3::ONE {
            change(root, index, *factor);
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

/// The document's light behind a light of the scene.
fn punctual_of(scene: &Scene, light: usize) -> Option<usize> {
    let node = scene.source.root.nodes.get(scene.lights[light].node)?;
    Some(node.extensions.as_ref()?.khr_lights_punctual.as_ref()?.light.value())
}

fn change_material(root: &mut Root, index: usize, factor: DVec3) {
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

fn change_punctual(root: &mut Root, index: usize, factor: DVec3) {
    let lights = root.extensions.as_mut().and_then(|extensions| extensions.khr_lights_punctual.as_mut());
    let Some(light) = lights.and_then(|lights| lights.lights.get_mut(index)) else { return };
    let (colour, above) = colour_and_rest(light.color, factor);
    light.color = colour;
    light.intensity *= above;
}

/// A colour times a factor: at most 1, and what it must be multiplied by.
fn colour_and_rest(colour: [f32; 3], factor: DVec3) -> ([f32; 3], f32) {
    let colour = DVec3::from_array(colour.map(f64::from)) * factor;
    let above = colour.max_element().max(1.0);
    ((colour / above).as_vec3().to_array(), above as f32)
}
