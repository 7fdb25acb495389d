//! Sky images within a scene, for clients that can send one file only: the bytes of the image's own file.

use std::borrow::Cow;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gltf::binary::{Glb, Header};
use gltf::json::Root;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::{SkyError, SkyImage};
use crate::PlainDocument;
use crate::buffers::read_uri;
use crate::error::ImportProblem;

/// Own extension of a document: its sky as an equirectangular image. The lit file has it no more.
pub const HALFLIGHT_SKY_IMAGE: &str = "HALFLIGHT_sky_image";

/// How the URI of the image begins.
const DATA: &str = "data:application/octet-stream;base64,";

#[derive(Serialize, Deserialize)]
struct Entry {
    /// A data URI: OpenEXR or Radiance HDR.
    uri: String,
    /// See [`SkyImage::turned`].
    rotation: f64,
    /// Factor of the radiance.
    intensity: f64,
}

/// Why a sky cannot be put into a scene.
#[derive(Debug, thiserror::Error)]
pub enum PutSkyError {
    /// The image.
    #[error(transparent)]
    Sky(#[from] SkyError),
    /// The scene.
    #[error("is no glTF that a sky can be put into: {0}; export it again")]
    Scene(String),
}

/// The sky image of a document, if it has one, and the factor of its radiance.
///
/// # Errors
/// When it cannot be read.
pub(super) fn image_of(file: &PlainDocument) -> Result<Option<(SkyImage, f64)>, ImportProblem> {
    let Some(value) = file.document.extension_value(HALFLIGHT_SKY_IMAGE) else { return Ok(None) };
    let wrong = |detail: String| ImportProblem::Light {
        place: "the sky of the scene".to_owned(),
        extension: HALFLIGHT_SKY_IMAGE,
        detail,
    };
    let entry = Entry::deserialize(value).map_err(|error| wrong(error.to_string()))?;
    if !(entry.intensity.is_finite() && entry.intensity >= 0.0 && entry.rotation.is_finite()) {
        let (intensity, rotation) = (entry.intensity, entry.rotation);
        return Err(wrong(format!("its intensity is {intensity} and its rotation {rotation}")));
    }
    // A file beside the scene is what --sky is for.
    let bytes = read_uri(&entry.uri, None, 0).map_err(&wrong)?;
    let image = SkyImage::from_bytes(&bytes).map_err(|error| wrong(format!("its image {error}")))?;
    if !image.texels.iter().flatten().all(|value| (f64::from(*value) * entry.intensity).is_finite()) {
        return Err(wrong(format!("its intensity of {} is too large", entry.intensity)));
    }
    Ok(Some((image.turned(entry.rotation), entry.intensity)))
}

/// Takes the sky image out of a document.
pub fn take_sky_image(root: &mut Root) {
    if let Some(extensions) = &mut root.extensions {
        extensions.others.remove(HALFLIGHT_SKY_IMAGE);
        let left = serde_json::to_value(extensions);
        if left.is_ok_and(|left| left == Value::Object(Map::new())) {
            root.extensions = None;
        }
    }
    root.extensions_used.retain(|name| name != HALFLIGHT_SKY_IMAGE);
}

/// A scene, `.glb` or `.gltf`, with the file of an equirectangular image as its sky, turned by `rotation` degrees and multiplied by
/// `intensity`.
///
/// # Errors
/// When the image or the scene cannot be read.
pub fn put_sky_image(
    scene: &[u8],
    image: &[u8],
    rotation: f64,
    intensity: f64,
) -> Result<Vec<u8>, PutSkyError> {
    SkyImage::from_bytes(image)?;
    let wrong = |error: &dyn std::fmt::Display| PutSkyError::Scene(error.to_string());
    let is_binary = scene.starts_with(b"glTF");
    let glb = is_binary.then(|| Glb::from_slice(scene).map_err(|error| wrong(&error))).transpose()?;
    let json = glb.as_ref().map_or(scene, |glb| &glb.json);
    let mut document: Map<String, Value> = serde_json::from_slice(json).map_err(|error| wrong(&error))?;
    let entry = Entry { uri: DATA.to_owned() + &STANDARD.encode(image), rotation, intensity };
    let entry = serde_json::to_value(entry).map_err(|error| wrong(&error))?;
    let extensions = document.entry("extensions").or_insert_with(|| Value::Object(Map::new()));
    let extensions = extensions.as_object_mut().ok_or_else(|| wrong(&"its extensions are no object"))?;
    extensions.insert(HALFLIGHT_SKY_IMAGE.to_owned(), entry);
    let used = document.entry("extensionsUsed").or_insert_with(|| Value::Array(vec![]));
    let used = used.as_array_mut().ok_or_else(|| wrong(&"its extensionsUsed are no list"))?;
    if !used.iter().any(|name| name == HALFLIGHT_SKY_IMAGE) {
        used.push(HALFLIGHT_SKY_IMAGE.into());
    }
    let json = serde_json::to_vec(&document).map_err(|error| wrong(&error))?;
    let Some(glb) = glb else { return Ok(json) };
    let header = Header { magic: *b"glTF", version: 2, length: 0 };
    Glb { header, json: Cow::Owned(json), bin: glb.bin }.to_vec().map_err(|error| wrong(&error))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::{ReadOptions, read};

    /// A Radiance HDR image of 2 by 1 texels, without run lengths: 1 and 2,048.
    fn image() -> Vec<u8> {
        let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".to_vec();
        bytes.extend([128, 128, 128, 129, 128, 128, 128, 140]);
        bytes
    }

    fn document() -> Value {
        json!({ "asset": { "version": "2.0" }, "scenes": [{ "nodes": [] }], "scene": 0 })
    }

    fn binary() -> Vec<u8> {
        let header = Header { magic: *b"glTF", version: 2, length: 0 };
        let json = document().to_string().into_bytes();
        Glb { header, json: json.into(), bin: Some(vec![1, 2, 3, 4].into()) }.to_vec().unwrap()
    }

    #[test]
    fn scenes_have_the_sky_that_was_put_into_them() {
        for scene in [document().to_string().into_bytes(), binary()] {
            let with_sky = put_sky_image(&scene, &image(), 90.0, 3.0).unwrap();
            let file = read(&with_sky, None, &ReadOptions::default()).unwrap();
            let (found, factor) = image_of(&file).unwrap().unwrap();
            let expected = SkyImage::from_bytes(&image()).unwrap().turned(90.0);
            assert_eq!((found.texels, found.rotation, factor), (expected.texels, expected.rotation, 3.0));
            let mut root = file.document.into_json();
            take_sky_image(&mut root);
            assert!(!root.to_string().unwrap().contains("extensions"));
        }
    }

    #[test]
    fn the_binary_chunk_stays() {
        let with_sky = put_sky_image(&binary(), &image(), 0.0, 1.0).unwrap();
        assert_eq!(Glb::from_slice(&with_sky).unwrap().bin.unwrap().as_ref(), [1, 2, 3, 4]);
    }

    #[test]
    fn what_is_no_sky_or_no_scene_is_refused() {
        assert!(matches!(put_sky_image(&binary(), b"PNG", 0.0, 1.0), Err(PutSkyError::Sky(_))));
        for scene in [&b"glTF"[..], b"{", b"[]", b"{\"extensions\": 3}", b"{\"extensionsUsed\": {}}"] {
            assert!(matches!(put_sky_image(scene, &image(), 0.0, 1.0), Err(PutSkyError::Scene(_))));
        }
    }

    #[test]
    fn damaged_skies_are_refused_by_name() {
        let uri = DATA.to_owned() + &STANDARD.encode(image());
        for (uri, rotation, intensity) in
            [("sky.hdr", 0.0, 1.0), ("data:;base64,AAAA", 0.0, 1.0), (&uri, 0.0, -1.0), (&uri, 0.0, 1e308)]
        {
            let mut scene = document();
            scene["extensions"][HALFLIGHT_SKY_IMAGE] =
                json!({ "uri": uri, "rotation": rotation, "intensity": intensity });
            let file = read(scene.to_string().as_bytes(), None, &ReadOptions::default()).unwrap();
            let error = image_of(&file).unwrap_err().to_string();
            assert!(error.contains(HALFLIGHT_SKY_IMAGE), "{error}");
        }
    }
}
