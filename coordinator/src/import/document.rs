//! From bytes to a validated glTF document.

use gltf::binary;
use gltf::json::validation::{Checked, Error as Fault};
use gltf::{Document, Gltf, Semantic, json};

use super::error::ImportProblem;

/// Extensions that change nothing here, or are understood.
const UNDERSTOOD: [&str; 4] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_unlit",
    "KHR_texture_transform",
];

/// Smallest GLB: its header.
const GLB_HEADER: usize = 12;

/// Parses and validates GLB or JSON. Gives the document and the binary chunk of a GLB.
///
/// Images are not decoded, buffers not resolved.
pub(super) fn parse(bytes: &[u8]) -> Result<(Document, Option<Vec<u8>>), ImportProblem> {
    check_container(bytes)?;
    let gltf = Gltf::from_slice_without_validation(bytes).map_err(problem)?;
    let blob = gltf.blob;
    let root = gltf.document.into_json();
    check_version(&root)?;
    check_required_extensions(&root)?;
    check_position_accessors(&root)?;
    let document = Document::from_json(root).map_err(problem)?;
    Ok((document, blob))
}

/// One warning for all extensions that are in use and ignored.
pub(super) fn warn_ignored_extensions(root: &json::Root, warnings: &mut Vec<String>) {
    let ignored: Vec<&str> =
        root.extensions_used.iter().map(String::as_str).filter(|name| !UNDERSTOOD.contains(name)).collect();
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

fn check_version(root: &json::Root) -> Result<(), ImportProblem> {
    let version = &root.asset.version;
    if version.split('.').next() == Some("2") {
        return Ok(());
    }
    Err(ImportProblem::Version { version: version.clone() })
}

/// Done before validation, which would only say "unsupported", or stumble over what the extension leaves out.
fn check_required_extensions(root: &json::Root) -> Result<(), ImportProblem> {
    let unsupported = |name: &&String| !json::extensions::ENABLED_EXTENSIONS.contains(&name.as_str());
    let Some(extension) = root.extensions_required.iter().find(unsupported) else { return Ok(()) };
    let cure = match extension.as_str() {
        "KHR_draco_mesh_compression" => "gltf-transform copy in.glb out.glb",
        "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "gltf-transform copy in.glb plain.glb && gltf-transform dequantize plain.glb out.glb"
        }
        "KHR_mesh_quantization" => "gltf-transform dequantize in.glb out.glb",
        _ => return Err(ImportProblem::ExtensionRequired { extension: extension.clone() }),
    };
    // Meshopt files mostly require quantization as well, which its own cure already undoes.
    let meshopt = root.extensions_required.iter().find(|name| name.ends_with("_meshopt_compression"));
    match meshopt {
        Some(meshopt) if meshopt != extension => Err(ImportProblem::CompressionRequired {
            extension: format!("{meshopt} and {extension}"),
            cure: "gltf-transform copy in.glb plain.glb && gltf-transform dequantize plain.glb out.glb",
        }),
        _ => Err(ImportProblem::CompressionRequired { extension: extension.clone(), cure }),
    }
}

/// The crate's validation follows the index of POSITION without a look at its range.
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

/// The crate's errors in our words.
fn problem(error: gltf::Error) -> ImportProblem {
    match error {
        gltf::Error::Binary(error) => container_problem(&error),
        gltf::Error::Deserialize(error) if error.is_eof() => {
            ImportProblem::Truncated { detail: format!("the JSON ends early, {error}") }
        }
        gltf::Error::Deserialize(error) => ImportProblem::Malformed { detail: error.to_string() },
        gltf::Error::Io(error) => ImportProblem::Unreadable(error),
        gltf::Error::Validation(faults) => match faults.first() {
            Some((path, Fault::IndexOutOfBounds)) => ImportProblem::DanglingIndex { path: path.to_string() },
            Some((path, Fault::Missing)) => ImportProblem::Malformed { detail: format!("{path} is missing") },
            Some((path, Fault::Oversize)) => {
                ImportProblem::Malformed { detail: format!("{path} is too large") }
            }
            Some((path, _)) => ImportProblem::Malformed { detail: format!("{path} has an invalid value") },
            None => ImportProblem::Malformed { detail: "validation failed".to_owned() },
        },
    }
}

fn container_problem(error: &binary::Error) -> ImportProblem {
    let truncated = |detail: String| ImportProblem::Truncated { detail };
    match error {
        binary::Error::Version(version) => ImportProblem::Version { version: version.to_string() },
        binary::Error::Magic(_) => ImportProblem::NotGltf,
        binary::Error::Length { length, length_read } => {
            truncated(format!("{length_read} of {length} bytes follow the GLB header"))
        }
        binary::Error::ChunkLength { length, length_read, .. } => {
            truncated(format!("a GLB chunk has {length_read} of {length} bytes"))
        }
        binary::Error::Io(_) => truncated("a GLB chunk header is cut off".to_owned()),
        binary::Error::ChunkType(_) | binary::Error::UnknownChunkType(_) => ImportProblem::Malformed {
            detail: "its GLB chunks are not JSON and BIN, in this order".to_owned(),
        },
    }
}
