//! Names of the attributes that hold parts of the light.

use std::borrow::Cow;

use glam::DVec3;
use gltf::Semantic;
use serde_json::{Value, json};

use super::ExportError;
use super::attributes::{IRRADIANCE, OCCLUSION, UNSHOT};
use bake::lit::LitMesh;

/// Attributes beside the whole light, each with its value at every vertex of the lit mesh.
pub(super) type Parts<'a> = Vec<(Semantic, Cow<'a, [DVec3]>)>;

/// All that the lit mesh has beside the whole light: its layers, what is still unshot, and how open it is. That has three equal
/// components, since Blender reads no two attributes of different shapes.
///
/// # Errors
/// When two layers would have the same attribute.
pub(super) fn parts(lit: &LitMesh) -> Result<Parts<'_>, ExportError> {
    let layers = lit.layers.iter().map(|layer| Cow::from(&layer.irradiance));
    let mut parts: Parts = semantics(lit)?.into_iter().zip(layers).collect();
    if !lit.unshot.is_empty() {
        parts.push((Semantic::Extras(UNSHOT.into()), Cow::from(&lit.unshot)));
    }
    if !lit.occlusion.is_empty() {
        let occlusion = lit.occlusion.iter().copied().map(DVec3::splat).collect();
        parts.push((Semantic::Extras(OCCLUSION.into()), occlusion));
    }
    Ok(parts)
}

/// The attribute of each layer.
///
/// # Errors
/// When two layers would have the same.
fn semantics(lit: &LitMesh) -> Result<Vec<Semantic>, ExportError> {
    let groups: Vec<&str> = lit.layers.iter().map(|layer| layer.name.as_str()).collect();
    check(&groups)?;
    Ok(groups.into_iter().map(|group| Semantic::Extras(attribute(group))).collect())
}

/// Whether each of these groups would have an attribute of its own.
///
/// # Errors
/// When two would have the same.
pub(super) fn check(groups: &[&str]) -> Result<(), ExportError> {
    for (index, group) in groups.iter().enumerate() {
        let name = attribute(group);
        if let Some(other) = groups[..index].iter().find(|other| attribute(other) == name) {
            let (one, other) = ((*other).to_owned(), (*group).to_owned());
            return Err(ExportError::SameGroup { one, other, attribute: format!("_{name}") });
        }
    }
    Ok(())
}

/// The description of the layers: name, attribute and lights of each.
pub(super) fn describe(lit: &LitMesh) -> Result<Value, ExportError> {
    let semantics = semantics(lit)?;
    let entry = |(layer, semantic): (&bake::lit::LitLayer, &Semantic)| json!({"name": layer.name, "attribute": semantic.to_string(), "lights": layer.lights});
    Ok(lit.layers.iter().zip(&semantics).map(entry).collect())
}

/// The attribute of a group, without its underscore: capital letters, digits and underscores, as the names of the format are.
pub(super) fn attribute(group: &str) -> String {
    let plain = |character: char| {
        if character.is_ascii_alphanumeric() { character.to_ascii_uppercase() } else { '_' }
    };
    format!("{IRRADIANCE}_{}", group.chars().map(plain).collect::<String>())
}
