//! The extensions' objects, read from the JSON a second time because the `gltf` crate drops unknown extensions.

use std::collections::BTreeMap;

use gltf::json::Root;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::UNDONE;
use crate::error::ImportProblem;

/// The extensions' objects, by the index of what they belong to.
#[derive(Default)]
pub(crate) struct Extensions {
    /// By buffer view.
    pub views: BTreeMap<usize, CompressedView>,
    /// By mesh and primitive.
    pub primitives: BTreeMap<(usize, usize), CompressedPrimitive>,
    /// By node: the attributes' accessors.
    pub instances: BTreeMap<usize, BTreeMap<String, usize>>,
    /// Buffers that only stand for decoded views.
    fallbacks: Vec<bool>,
}

/// A view that is compressed by meshoptimizer's codecs.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct CompressedView {
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: usize,
    pub byte_length: usize,
    pub byte_stride: usize,
    pub count: usize,
    pub mode: Mode,
    #[serde(default)]
    pub filter: Filter,
}

/// Which codec.
#[derive(Deserialize, Clone, Copy, PartialEq, Eq)]
#[serde(rename_all = "UPPERCASE")]
pub(crate) enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// Filter applied before compression.
#[derive(Deserialize, Clone, Copy, Default, PartialEq, Eq)]
#[serde(rename_all = "UPPERCASE")]
pub(crate) enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// A primitive that is compressed by Draco.
#[derive(Deserialize, Clone)]
#[serde(rename_all = "camelCase")]
pub(crate) struct CompressedPrimitive {
    pub buffer_view: usize,
    /// Identifiers in the compressed data, by the names of the primitive's attributes.
    pub attributes: BTreeMap<String, u32>,
}

impl Extensions {
    /// Reads them, if the document says that it uses any.
    ///
    /// A buffer without a name is the binary chunk, or else stands for decoded views alone.
    pub(crate) fn read(root: &Root, json: &[u8], has_blob: bool) -> Result<Self, ImportProblem> {
        let mut names = root.extensions_used.iter().chain(&root.extensions_required);
        if !names.any(|name| UNDONE.contains(&name.as_str())) {
            return Ok(Self::default());
        }
        let parts: Parts = serde_json::from_slice(json)
            .map_err(|error| ImportProblem::Malformed { detail: error.to_string() })?;
        let mut extensions = Self::default();
        for (index, part) in parts.buffer_views.into_iter().enumerate() {
            extensions
                .views
                .extend(part.extensions.and_then(ViewExtensions::either).map(|view| (index, view)));
        }
        for (mesh, part) in parts.meshes.into_iter().enumerate() {
            for (primitive, part) in part.primitives.into_iter().enumerate() {
                let compressed = part.extensions.and_then(|extensions| extensions.draco);
                extensions.primitives.extend(compressed.map(|draco| ((mesh, primitive), draco)));
            }
        }
        for (node, part) in parts.nodes.into_iter().enumerate() {
            let instancing = part.extensions.and_then(|extensions| extensions.instancing);
            extensions.instances.extend(instancing.map(|instancing| (node, instancing.attributes)));
        }
        extensions.fallbacks = parts.buffers.into_iter().map(|part| part.is_fallback()).collect();
        // A placeholder need not be marked: a buffer without data, for views that are decoded.
        for &view in extensions.views.keys() {
            let Some(buffer) = root.buffer_views.get(view).map(|view| view.buffer.value()) else { continue };
            let is_empty = root.buffers.get(buffer).is_some_and(|buffer| buffer.uri.is_none());
            if let Some(fallback) = extensions.fallbacks.get_mut(buffer) {
                *fallback |= is_empty && !(buffer == 0 && has_blob);
            }
        }
        Ok(extensions)
    }

    /// Whether a buffer holds nothing that is not decoded from elsewhere.
    pub(crate) fn is_fallback(&self, buffer: usize) -> bool {
        self.fallbacks.get(buffer).is_some_and(|&fallback| fallback)
    }
}

/// Takes the extensions' objects out of a document in which they are undone.
pub(super) fn remove(root: &mut Root) {
    for primitive in root.meshes.iter_mut().flat_map(|mesh| &mut mesh.primitives) {
        clean(&mut primitive.extensions, |extensions| &mut extensions.others);
    }
    for node in &mut root.nodes {
        clean(&mut node.extensions, |extensions| &mut extensions.others);
    }
    for buffer in &mut root.buffers {
        clean(&mut buffer.extensions, |extensions| &mut extensions.others);
    }
    for view in &mut root.buffer_views {
        clean(&mut view.extensions, |extensions| &mut extensions.others);
    }
}

/// Removes what is undone, and the whole object where nothing else is in it.
fn clean<T: Serialize>(object: &mut Option<T>, others: impl Fn(&mut T) -> &mut Map<String, Value>) {
    let Some(extensions) = object else { return };
    let members = others(extensions);
    let before = members.len();
    members.retain(|name, _| !UNDONE.contains(&name.as_str()));
    let changed = members.len() != before;
    if changed && serde_json::to_value(&*extensions).is_ok_and(|value| value == Value::Object(Map::new())) {
        *object = None;
    }
}

/// The parts of a document where the extensions stand.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
#[derive(Default)]
struct Parts {
    buffers: Vec<Part<BufferExtensions>>,
    buffer_views: Vec<Part<ViewExtensions>>,
    meshes: Vec<MeshPart>,
    nodes: Vec<Part<NodeExtensions>>,
}

#[derive(Deserialize)]
struct Part<T> {
    extensions: Option<T>,
}

#[derive(Deserialize)]
struct MeshPart {
    primitives: Vec<Part<PrimitiveExtensions>>,
}

#[derive(Deserialize)]
struct BufferExtensions {
    #[serde(rename = "EXT_meshopt_compression", alias = "KHR_meshopt_compression")]
    meshopt: Option<Fallback>,
}

#[derive(Deserialize)]
struct Fallback {
    #[serde(default)]
    fallback: bool,
}

impl Part<BufferExtensions> {
    fn is_fallback(&self) -> bool {
        let meshopt = self.extensions.as_ref().and_then(|extensions| extensions.meshopt.as_ref());
        meshopt.is_some_and(|meshopt| meshopt.fallback)
    }
}

#[derive(Deserialize)]
struct ViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    first: Option<CompressedView>,
    #[serde(rename = "KHR_meshopt_compression")]
    second: Option<CompressedView>,
}

impl ViewExtensions {
    fn either(self) -> Option<CompressedView> {
        self.second.or(self.first)
    }
}

#[derive(Deserialize)]
struct PrimitiveExtensions {
    #[serde(rename = "KHR_draco_mesh_compression")]
    draco: Option<CompressedPrimitive>,
}

#[derive(Deserialize)]
struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    instancing: Option<Instancing>,
}

#[derive(Deserialize)]
struct Instancing {
    attributes: BTreeMap<String, usize>,
}
