//! Extensions that the exporter does not know: kept, with what they might refer to.

use std::collections::BTreeSet;

use gltf::json::Root;
use gltf::json::extras::{Extras, RawValue};
use serde_json::{Map, Value};

use super::ExportError;

/// Extensions that name nothing that the exporter moves, besides `KHR_materials_*`: lights, textures and images stay where
/// they are.
const HARMLESS: [&str; 9] = [
    "EXT_lights_area",
    "EXT_lights_image_based",
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "MSFT_texture_dds",
];

/// Number of the input's first accessors and buffer views that must keep their indices.
///
/// Any whole number in an unknown extension may be the index of one, so those up to the largest such number stay.
///
/// # Errors
/// When the document cannot be expressed in JSON.
pub(super) fn pinned(input: &Root) -> Result<usize, ExportError> {
    let mut largest = None;
    each_extension(&input.to_value()?, &mut |name, payload| {
        if !HARMLESS.contains(&name) && (!name.starts_with("KHR_materials_")) {
            largest = largest.max(largest_whole_number(payload));
        }
    });
    let count = input.accessors.len().max(input.buffer_views.len());
    Ok(largest
        .map_or(0, |largest| usize::try_from(largest).unwrap_or(usize::MAX).saturating_add(1))
        .min(count))
}

/// Writes down which extensions the document uses, and requires no other.
///
/// # Errors
/// When the document cannot be expressed in JSON.
pub(super) fn declare(root: &mut Root) -> Result<(), ExportError> {
    let mut used = BTreeSet::new();
    each_extension(&root.to_value()?, &mut |name, _| {
        used.insert(name.to_owned());
    });
    root.extensions_required.retain(|name| used.contains(name));
    root.extensions_used = used.into_iter().collect();
    Ok(())
}

/// Adds a member `halflight` to an object's extras. Extras that are no object become their member `source`.
///
/// # Errors
/// When they cannot be expressed in JSON.
pub(super) fn note(extras: &mut Extras, members: Map<String, Value>) -> Result<(), ExportError> {
    let mut all = match extras.as_deref().map(|raw| serde_json::from_str(raw.get())).transpose()? {
        Some(Value::Object(members)) => members,
        None | Some(Value::Null) => Map::new(),
        Some(other) => Map::from_iter([("source".to_owned(), other)]),
    };
    all.insert("halflight".into(), members.into());
    *extras = Some(RawValue::from_string(serde_json::to_string(&all)?)?);
    Ok(())
}

/// Shows name and content of every extension in a glTF object and everything in it but extras, where anything may stand.
fn each_extension(value: &Value, look: &mut impl FnMut(&str, &Value)) {
    match value {
        Value::Array(items) => items.iter().for_each(|item| each_extension(item, look)),
        Value::Object(members) => {
            for (key, member) in members.iter().filter(|(key, _)| *key != "extras") {
                if let (true, Value::Object(used)) = (key == "extensions", member) {
                    used.iter().for_each(|(name, payload)| look(name, payload));
                }
                each_extension(member, look);
            }
        }
        _ => {}
    }
}

fn largest_whole_number(value: &Value) -> Option<u64> {
    match value {
        Value::Number(number) => number.as_u64(),
        Value::Array(items) => items.iter().filter_map(largest_whole_number).max(),
        Value::Object(members) => members.values().filter_map(largest_whole_number).max(),
        _ => None,
    }
}
