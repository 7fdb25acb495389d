//! Skies within a scene: cube maps of EXT_lights_image_based.

use std::collections::BTreeSet;

use glam::{DQuat, DVec4};
use serde::Deserialize;

use super::{MOST_WIDTH, Projection, SkyImage};
use crate::PlainDocument;
use crate::error::ImportProblem;
use crate::images;
use crate::texture::Encoding;

/// Lights as cube maps. The file's irradiance coefficients do not count: they know of nothing that stands before the sky.
pub const EXT_LIGHTS_IMAGE_BASED: &str = "EXT_lights_image_based";

/// Smallest alpha by which colours are divided: that of eight bits.
const LEAST_ALPHA: f64 = 1.0 / 255.0;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Entry {
    #[serde(default = "one")]
    intensity: f64,
    #[serde(default = "no_rotation")]
    rotation: [f64; 4],
    specular_images: Vec<Vec<usize>>,
}

fn one() -> f64 {
    1.0
}

fn no_rotation() -> [f64; 4] {
    DQuat::IDENTITY.to_array()
}

/// The sky of the document's scene, if it has one: the sharpest images of its light. Those that cannot be decoded are a warning, and no
/// sky.
///
/// # Errors
/// When the scene refers to no light, or to one that makes no sense.
pub(super) fn sky_of(
    file: &PlainDocument,
    warnings: &mut Vec<String>,
) -> Result<Option<SkyImage>, ImportProblem> {
    let wrong = |detail: String| ImportProblem::Light {
        place: "the sky of the scene".to_owned(),
        extension: EXT_LIGHTS_IMAGE_BASED,
        detail,
    };
    let scene = file.document.default_scene();
    let Some(reference) = scene.and_then(|scene| scene.extension_value(EXT_LIGHTS_IMAGE_BASED).cloned())
    else {
        return Ok(None);
    };
    let index = reference.get("light").and_then(serde_json::Value::as_u64);
    let index = index.ok_or_else(|| wrong("the scene does not say which light it has".into()))?;
    let lights = file.document.extension_value(EXT_LIGHTS_IMAGE_BASED).and_then(|own| own.get("lights"));
    let light = lights.and_then(|lights| lights.get(usize::try_from(index).ok()?));
    let light = light.ok_or_else(|| wrong(format!("the file has no light {index}")))?;
    let entry = Entry::deserialize(light).map_err(|error| wrong(error.to_string()))?;
    if !(entry.intensity.is_finite() && entry.intensity >= 0.0) {
        return Err(wrong(format!("its intensity is {}, expected finite and not negative", entry.intensity)));
    }
    let rotation = DVec4::from_array(entry.rotation);
    if !(0.001..1000.0).contains(&rotation.length()) {
        return Err(wrong("its rotation is no quaternion".into()));
    }
    let faces = entry.specular_images.first().filter(|faces| faces.len() == 6);
    let faces = faces.ok_or_else(|| wrong("it has no six specularImages".into()))?;
    let needed: BTreeSet<usize> = faces.iter().copied().collect();
    let decoded = images::decode(file, &needed, warnings);
    let Some(faces) = faces.iter().map(|face| decoded.get(face)).collect::<Option<Vec<_>>>() else {
        warnings.push("the sky is left out: not all of its images can be read".to_owned());
        return Ok(None);
    };
    let edge = faces[0].width();
    if faces.iter().any(|face| [face.width(), face.height()] != [edge; 2]) {
        return Err(wrong("its images are not squares of one size".into()));
    }
    if edge as usize > MOST_WIDTH / 4 {
        return Err(wrong(format!(
            "its images have {edge} texels along an edge; scale them down to {}",
            MOST_WIDTH / 4
        )));
    }
    // Colours are divided by alpha, which is 1 in images without one.
    let linear = |[r, g, b, a]: [u8; 4]| {
        let alpha = (f64::from(a) / 255.0).max(LEAST_ALPHA);
        [r, g, b].map(|stored| (Encoding::Srgb.decode(stored) / alpha * entry.intensity) as f32)
    };
    let texels: Vec<[f32; 3]> =
        faces.iter().flat_map(|face| face.texels().iter().copied().map(linear)).collect();
    if !texels.iter().flatten().all(|value| value.is_finite()) {
        return Err(wrong(format!("its intensity of {} is too large", entry.intensity)));
    }
    let rotation = DQuat::from_vec4(rotation.normalize());
    Ok(Some(SkyImage { projection: Projection::Cube { edge: edge as usize }, texels, rotation }))
}
