//! Diffuse reflectance and exitance of materials.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use glam::DVec3;
use gltf::Material;
use gltf::material::AlphaMode;

use super::error::ImportProblem;

/// Largest reflectance. At 1 light would never be absorbed and nothing would converge in a closed scene.
const MAX_REFLECTANCE: f64 = 0.999;

/// What the solver needs of a material.
#[derive(Clone, Copy)]
pub(super) struct Diffuse {
    /// baseColorFactor x (1 - metallicFactor), clamped below 1.
    pub(super) reflectance: DVec3,
    /// pi x emissiveFactor x emissiveStrength: the exitance of a diffuse emitter of that radiance.
    pub(super) exitance: DVec3,
}

/// Materials in use, each evaluated and warned about once.
#[derive(Default)]
pub(super) struct Materials {
    by_index: BTreeMap<Option<usize>, Diffuse>,
}

impl Materials {
    /// Reflectance and exitance, or which factor is out of range.
    pub(super) fn diffuse(
        &mut self,
        material: &Material,
        warnings: &mut Vec<String>,
    ) -> Result<Diffuse, ImportProblem> {
        if let Some(&known) = self.by_index.get(&material.index()) {
            return Ok(known);
        }
        let diffuse = evaluate(material, warnings)?;
        self.by_index.insert(material.index(), diffuse);
        Ok(diffuse)
    }
}

fn evaluate(material: &Material, warnings: &mut Vec<String>) -> Result<Diffuse, ImportProblem> {
    let label = label(material);
    let surface = material.pbr_metallic_roughness();
    let factor = |name, value: f32, max: f32, expected| {
        if value.is_finite() && (0.0..=max).contains(&value) {
            return Ok(f64::from(value));
        }
        Err(ImportProblem::Factor { place: label.clone(), factor: name, value, expected })
    };
    let colour = |name, value: [f32; 3]| {
        let channel = |value| factor(name, value, f32::MAX, "finite and not negative");
        Ok(DVec3::new(channel(value[0])?, channel(value[1])?, channel(value[2])?))
    };

    let [red, green, blue, _] = surface.base_color_factor();
    let base = colour("baseColorFactor", [red, green, blue])?;
    let metallic = factor("metallicFactor", surface.metallic_factor(), 1.0, "from 0 to 1")?;
    let strength = material.emissive_strength().unwrap_or(1.0);
    let strength = factor("emissiveStrength", strength, f32::MAX, "finite and not negative")?;
    let exitance = PI * strength * colour("emissiveFactor", material.emissive_factor())?;

    let reflectance = base * (1.0 - metallic);
    if reflectance.max_element() >= 1.0 {
        warnings.push(format!(
            "{label}: reflectance clamped from {:.3} to {MAX_REFLECTANCE}",
            reflectance.max_element()
        ));
    }
    if metallic == 1.0 && base != DVec3::ZERO && exitance == DVec3::ZERO {
        let default = if material.index().is_none() { ", as glTF's default material is" } else { "" };
        warnings.push(format!(
            "{label}: fully metallic{default}, so it reflects no diffuse light; set metallicFactor to 0 if it should"
        ));
    }
    if material.alpha_mode() != AlphaMode::Opaque {
        warnings.push(format!("{label}: transparency is ignored, it blocks all light"));
    }
    let textures = [
        ("base colour", surface.base_color_texture().is_some()),
        ("metallic-roughness", surface.metallic_roughness_texture().is_some()),
        ("emissive", material.emissive_texture().is_some()),
        ("normal", material.normal_texture().is_some()),
        ("occlusion", material.occlusion_texture().is_some()),
    ];
    let ignored: Vec<&str> = textures.iter().filter(|(_, present)| *present).map(|(name, _)| *name).collect();
    if !ignored.is_empty() {
        warnings.push(format!("{label}: textures ignored, only its factors count: {}", ignored.join(", ")));
    }
    Ok(Diffuse { reflectance: reflectance.min(DVec3::splat(MAX_REFLECTANCE)), exitance })
}

fn label(material: &Material) -> String {
    match (material.name(), material.index()) {
        (Some(name), _) if !name.is_empty() => format!("material \"{name}\""),
        (_, Some(index)) => format!("material {index}"),
        (_, None) => "the default material".to_owned(),
    }
}
