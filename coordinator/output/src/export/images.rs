//! Image files beside the input, embedded in the output.

use std::path::Path;

use gltf::json::Root;
use gltf::json::image::MimeType;

use super::ExportError;
use super::buffer::NewData;
use document::read_uri;
use scene::SourceDocument;

/// First bytes of the formats that images come in.
const SIGNATURES: [(&str, usize, &[u8]); 6] = [
    ("image/png", 0, b"\x89PNG\r\n\x1a\n"),
    ("image/jpeg", 0, b"\xff\xd8\xff"),
    ("image/webp", 8, b"WEBP"),
    ("image/ktx2", 0, b"\xabKTX 20\xbb"),
    ("image/avif", 4, b"ftypavif"),
    ("image/vnd-ms.dds", 0, b"DDS "),
];

/// Longest part of a URI that a warning repeats.
const SHOWN: usize = 80;

/// Embeds the document's image files in its buffer, byte for byte; for a `.glb`, data URIs too.
///
/// A `.gltf` in the input's own folder keeps its references. Images that cannot be read stay references, with a warning.
pub(super) fn embed(
    root: &mut Root,
    source: &SourceDocument,
    output: &Path,
    new: &mut NewData,
) -> Result<Vec<String>, ExportError> {
    let mut warnings = Vec::new();
    let is_binary = output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("glb"));
    let moves =
        |folder: &Path| is_binary || !is_same_folder(folder, output.parent().unwrap_or(Path::new("")));
    let folder = source.folder.as_ref().filter(|folder| moves(folder.path()));
    for index in 0..root.images.len() {
        let Some(uri) = root.images[index].uri.clone() else { continue };
        let of_data = uri.strip_prefix("data:").and_then(|data| data.split([';', ',']).next());
        let stays = if of_data.is_some() { !is_binary } else { folder.is_none() };
        if stays {
            continue;
        }
        let shown: String = uri.chars().take(SHOWN).collect();
        match read_uri(&uri, folder, u64::from(u32::MAX)) {
            Ok(bytes) => {
                let stated = root.images[index].mime_type.as_ref().map(|MimeType(stated)| stated.as_str());
                let Some(format) = format(&bytes).or(stated).or(of_data).map(str::to_owned) else {
                    warnings.push(format!(
                        "image {shown} is of no known format: the output names it as the input does"
                    ));
                    continue;
                };
                let view = new.push_view(root, bytes, None);
                let image = &mut root.images[index];
                image.uri = None;
                image.buffer_view = Some(view);
                image.mime_type = Some(MimeType(format));
            }
            Err(why) => {
                warnings.push(format!(
                    "image {shown} is not in the output, which names it as the input does: {why}"
                ));
            }
        }
    }
    Ok(warnings)
}

fn format(bytes: &[u8]) -> Option<&'static str> {
    let begins = |(_, offset, signature): &&(&str, usize, &[u8])| {
        bytes.get(*offset..).is_some_and(|rest| rest.starts_with(signature))
    };
    SIGNATURES.iter().find(begins).map(|(name, ..)| *name)
}

fn is_same_folder(one: &Path, other: &Path) -> bool {
    let whole = |path: &Path| if path == Path::new("") { Path::new(".") } else { path }.canonicalize();
    matches!((whole(one), whole(other)), (Ok(one), Ok(other)) if one == other)
}
