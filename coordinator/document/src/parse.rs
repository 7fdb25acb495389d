//! From bytes to a validated glTF document.

use std::borrow::Cow;

use gltf::binary;
use gltf::json::validation::Checked;
use gltf::{Document, Semantic, json};
use serde::Deserialize;
use serde_json::Value;

use super::error::ImportProblem;
use super::images::IMAGE_EXTENSIONS;
use super::nodes::NODE_VISIBILITY;
use super::sky::{EXT_LIGHTS_IMAGE_BASED, HALFLIGHT_SKY_IMAGE};
use super::{nesting, prepare, scene_choice};

/// Extensions that are supported, or do not affect the light, besides those of images.
const UNDERSTOOD: [&str; 11] = [
    EXT_LIGHTS_AREA,
    EXT_LIGHTS_IMAGE_BASED,
    HALFLIGHT_SKY_IMAGE,
    NODE_VISIBILITY,
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_texture_transform",
];

/// Area lights: a draft, not known to the crate either.
pub const EXT_LIGHTS_AREA: &str = "EXT_lights_area";

/// Begins the names of extensions that say how a surface looks: the rest of the file is read right where one of them is not known.
const LOOKS: &str = "KHR_materials_";

/// Whether a file may require this extension though the crate does not know it: it is read here, or may be ignored.
pub(crate) fn may_be_required(name: &str) -> bool {
    let read = [EXT_LIGHTS_AREA, EXT_LIGHTS_IMAGE_BASED, NODE_VISIBILITY];
    let is_known = json::extensions::ENABLED_EXTENSIONS.contains(&name);
    !is_known && (read.contains(&name) || name.starts_with(LOOKS))
}

/// Smallest GLB: its header.
const GLB_HEADER: usize = 12;

/// A parsed document, not validated yet: compressed ones would not pass.
pub(crate) struct Parsed<'a> {
    /// The document.
    pub root: json::Root,
    /// Its JSON.
    pub json: Cow<'a, [u8]>,
    /// The binary chunk of a GLB.
    pub blob: Option<Vec<u8>>,
}

/// Parses GLB or JSON. Images are not decoded, buffers not resolved.
pub(crate) fn parse(bytes: &[u8]) -> Result<Parsed<'_>, ImportProblem> {
    check_container(bytes)?;
    let (json, blob) = if bytes.starts_with(b"glTF") {
        let glb = binary::Glb::from_slice(bytes).map_err(ImportProblem::from)?;
        (glb.json, glb.bin.map(Cow::into_owned))
    } else {
        (Cow::Borrowed(bytes), None)
    };
    nesting::check(&json)?;
    let root = json::Root::from_slice(&json).or_else(|error| read_otherwise(&json, error))?;
    check_version(&root.asset.version)?;
    check_least_version(root.asset.min_version.as_deref())?;
    check_required_extensions(&root)?;
    Ok(Parsed { root, json, blob })
}

/// Parses a document that the crate refuses: of another version, with a scene without `nodes`, which the specification allows,
/// or with [texture coordinates below 0](first_coordinates).
fn read_otherwise(json: &[u8], error: serde_json::Error) -> Result<json::Root, ImportProblem> {
    #[derive(Deserialize)]
    struct Asset {
        /// Early files have a number.
        version: Value,
    }
    #[derive(Deserialize)]
    struct Versioned {
        asset: Asset,
    }
    let failed = || ImportProblem::from(gltf::Error::Deserialize(error));
    let Ok(Versioned { asset }) = serde_json::from_slice(json) else { return Err(failed()) };
    check_version(&asset.version.as_str().map_or_else(|| asset.version.to_string(), str::to_owned))?;
    let Ok(mut document) = serde_json::from_slice::<Value>(json) else { return Err(failed()) };
    let scenes = document.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten();
    for scene in scenes.filter_map(Value::as_object_mut) {
        scene.entry("nodes").or_insert_with(|| Value::Array(vec![]));
    }
    document.get_mut("materials").into_iter().for_each(first_coordinates);
    // As text, which the crate has its parser for. The first error tells the place in the file.
    serde_json::to_vec(&document).and_then(|json| json::Root::from_slice(&json)).map_err(|_| failed())
}

/// Makes texture coordinates of set -1 those of the first set, as viewers do: exporters write it for materials whose image
/// names no coordinates.
fn first_coordinates(value: &mut Value) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(first_coordinates),
        Value::Object(members) => {
            if members.get("texCoord").and_then(Value::as_i64).is_some_and(|set| set < 0) {
                members.insert("texCoord".to_owned(), 0.into());
            }
            let read = members.iter_mut().filter(|(name, _)| *name != "extras");
            read.for_each(|(_, member)| first_coordinates(member));
        }
        _ => {}
    }
}

/// Validates a document and makes `scene` its default scene.
pub(crate) fn validate(mut root: json::Root, scene: Option<&str>) -> Result<Document, ImportProblem> {
    check_position_accessors(&root)?;
    scene_choice::choose(&mut root, scene)?;
    // The crate refuses documents that require what it does not know.
    root.extensions_required.retain(|name| !IMAGE_EXTENSIONS.contains(&&**name) && !may_be_required(name));
    Document::from_json(root).map_err(ImportProblem::from)
}

/// Restores required extensions after validation: these, and those of images that textures have instead of their own.
pub fn require_again(root: &mut json::Root, required: Vec<String>) {
    root.extensions_required.extend(required);
    let is_empty = |texture: &&json::Texture| texture.source.value() == u32::MAX as usize;
    for name in IMAGE_EXTENSIONS {
        let has_image = |texture: &json::Texture| {
            texture.extensions.as_ref().is_some_and(|extensions| extensions.others.contains_key(name))
        };
        if root.textures.iter().filter(is_empty).any(has_image) {
            root.extensions_required.push(name.to_owned());
        }
    }
}

/// Whether an extension is supported, or does not affect the light.
#[must_use]
pub fn is_understood(name: &str) -> bool {
    UNDERSTOOD.contains(&name) || IMAGE_EXTENSIONS.contains(&name)
}

/// Adds one warning that lists the extensions in use that are ignored.
pub fn warn_ignored_extensions(root: &json::Root, warnings: &mut Vec<String>) {
    let ignored: Vec<&str> =
        root.extensions_used.iter().map(String::as_str).filter(|name| !is_understood(name)).collect();
    if !ignored.is_empty() {
        warnings.push(format!("extensions ignored: {}", ignored.join(", ")));
    }
}

/// The parser subtracts the header's size from the length that a GLB states, whatever that is.
fn check_container(bytes: &[u8]) -> Result<(), ImportProblem> {
    if bytes.starts_with(b"glTF") {
        let Some(length) = bytes.get(8..GLB_HEADER) else {
            return Err(ImportProblem::Truncated {
                detail: format!("{} bytes are no GLB header", bytes.len()),
            });
        };
        // The first version has a shorter header, and says how long the file is, not the rest of it.
        if bytes[4..8] == [1, 0, 0, 0] {
            return Err(ImportProblem::Version { version: "1".to_owned() });
        }
        let stated = u32::from_le_bytes([length[0], length[1], length[2], length[3]]);
        if (stated as usize) < GLB_HEADER {
            return Err(ImportProblem::Malformed { detail: format!("its GLB header states {stated} bytes") });
        }
        return Ok(());
    }
    match bytes.iter().find(|byte| !byte.is_ascii_whitespace()) {
        Some(b'{') => Ok(()),
        _ => Err(ImportProblem::NotGltf),
    }
}

fn check_version(version: &str) -> Result<(), ImportProblem> {
    if version.split('.').next() == Some("2") {
        return Ok(());
    }
    Err(ImportProblem::Version { version: version.to_owned() })
}

/// The version that a reader must know at least: what came after 2.0 is not read.
fn check_least_version(least: Option<&str>) -> Result<(), ImportProblem> {
    match least {
        Some(version) if version != "2.0" && version != "2" => {
            Err(ImportProblem::Version { version: format!("{version} at least") })
        }
        _ => Ok(()),
    }
}

/// Done before validation, which would only say "unsupported".
fn check_required_extensions(root: &json::Root) -> Result<(), ImportProblem> {
    let is_read = |name: &&String| {
        json::extensions::ENABLED_EXTENSIONS.contains(&name.as_str())
            || prepare::UNDONE.contains(&name.as_str())
            || IMAGE_EXTENSIONS.contains(&name.as_str())
            || may_be_required(name)
    };
    match root.extensions_required.iter().find(|name| !is_read(name)) {
        Some(extension) => Err(ImportProblem::ExtensionRequired { extension: extension.clone() }),
        None => Ok(()),
    }
}

/// The crate's validation follows the index of POSITION without checking its range.
fn check_position_accessors(root: &json::Root) -> Result<(), ImportProblem> {
    for (mesh, primitive, attributes) in root.meshes.iter().enumerate().flat_map(|(mesh, value)| {
        value
            .primitives
            .iter()
            .enumerate()
            .map(move |(primitive, value)| (mesh, primitive, &value.attributes))
    }) {
        let position = attributes.get(&Checked::Valid(Semantic::Positions));
        if position.is_some_and(|index| index.value() >= root.accessors.len()) {
            let path = format!("meshes[{mesh}].primitives[{primitive}].attributes.POSITION");
            return Err(ImportProblem::DanglingIndex { path });
        }
    }
    Ok(())
}
