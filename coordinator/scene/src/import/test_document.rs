//! Small glTF documents for tests.

use gltf::binary::{Glb, Header};
use serde_json::{Value, json};

use super::{ImportError, ImportOptions, ImportProblem, import_slice};
use crate::model::Scene;

/// Component type of floats.
pub(super) const FLOAT: u32 = 5126;
/// Component type of 32-bit indices.
pub(super) const UNSIGNED_INT: u32 = 5125;

/// Corners of the unit square in the plane z = 0, counter-clockwise seen from +z.
pub(super) const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
/// Its triangles.
pub(super) const SQUARE_INDICES: [u32; 6] = [0, 1, 2, 0, 2, 3];

/// A glTF under construction: JSON that tests may bend as they like, and one buffer.
pub(super) struct TestDocument {
    /// The JSON.
    pub(super) root: Value,
    /// The buffer.
    pub(super) bin: Vec<u8>,
}

impl TestDocument {
    /// Without any content but a material (0) that shines and reflects half.
    pub(super) fn new() -> Self {
        let root = json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [] }],
            "nodes": [], "meshes": [], "accessors": [], "bufferViews": [],
            "materials": [{
                "name": "lamp", "emissiveFactor": [1.0, 1.0, 1.0],
                "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1.0], "metallicFactor": 0.0 },
            }],
        });
        Self { root, bin: Vec::new() }
    }

    /// A lamp: the unit square.
    pub(super) fn square() -> Self {
        Self::with_triangles(&SQUARE, &SQUARE_INDICES)
    }

    /// One node `thing` with one primitive of material 0.
    pub(super) fn with_triangles(positions: &[[f32; 3]], indices: &[u32]) -> Self {
        let mut document = Self::new();
        let (positions, indices) = (document.vectors(positions), document.indices(indices));
        document
            .node_with(json!({ "attributes": { "POSITION": positions }, "indices": indices, "material": 0 }));
        document
    }

    /// Appends to an array of the root and returns the index.
    pub(super) fn push(&mut self, array: &str, value: Value) -> usize {
        let values = self.root[array].as_array_mut().unwrap();
        values.push(value);
        values.len() - 1
    }

    /// An accessor over bytes of its own.
    pub(super) fn accessor(&mut self, bytes: &[u8], component: u32, shape: &str, count: usize) -> usize {
        while !self.bin.len().is_multiple_of(4) {
            self.bin.push(0);
        }
        let view = json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() });
        let view = self.push("bufferViews", view);
        self.bin.extend_from_slice(bytes);
        let bounds = [0.0; 3];
        self.push("accessors", json!({
            "bufferView": view, "componentType": component, "type": shape, "count": count, "min": bounds, "max": bounds,
        }))
    }

    /// An accessor of floats.
    pub(super) fn floats<const N: usize>(&mut self, shape: &str, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(&bytes, FLOAT, shape, values.len())
    }

    /// Positions or normals.
    pub(super) fn vectors(&mut self, values: &[[f32; 3]]) -> usize {
        self.floats("VEC3", values)
    }

    /// 32-bit indices.
    pub(super) fn indices(&mut self, values: &[u32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(&bytes, UNSIGNED_INT, "SCALAR", values.len())
    }

    /// A root node `thing` with a mesh of one primitive, below those before it: on them it would be a layer.
    pub(super) fn node_with(&mut self, primitive: Value) -> usize {
        let mesh = self.push("meshes", json!({ "primitives": [primitive] }));
        let node = self.root_node(json!({ "name": "thing", "mesh": mesh }));
        if node > 0 {
            self.root["nodes"][node]["translation"] = json!([0, 0, -(node as i32)]);
        }
        node
    }

    /// A node of the scene.
    pub(super) fn root_node(&mut self, node: Value) -> usize {
        let node = self.push("nodes", node);
        self.root["scenes"][0]["nodes"].as_array_mut().unwrap().push(node.into());
        node
    }

    /// A node with a light.
    pub(super) fn light(&mut self, light: Value, node: Value) {
        self.root["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        self.root["extensions"] = json!({ "KHR_lights_punctual": { "lights": [light] } });
        let node = self.root_node(node);
        self.root["nodes"][node]["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
    }

    /// The JSON with its buffer, at `uri` if there is one.
    pub(super) fn json(&self, uri: Option<&str>) -> Vec<u8> {
        let mut root = self.root.clone();
        if root.get("buffers").is_none() && !self.bin.is_empty() {
            root["buffers"] = json!([{ "byteLength": self.bin.len() }]);
        }
        if let Some(uri) = uri {
            root["buffers"][0]["uri"] = uri.into();
        }
        serde_json::to_vec(&root).unwrap()
    }

    /// As GLB.
    pub(super) fn glb(&self) -> Vec<u8> {
        let header = Header { magic: *b"glTF", version: 2, length: 0 };
        let bin = (!self.bin.is_empty()).then_some(self.bin.as_slice().into());
        Glb { header, json: self.json(None).into(), bin }.to_vec().unwrap()
    }

    /// Imports it, which must succeed.
    pub(super) fn scene(&self) -> Scene {
        self.import().unwrap()
    }

    /// Imports it, which must fail.
    pub(super) fn problem(&self) -> ImportProblem {
        *self.import().unwrap_err().problem
    }

    fn import(&self) -> Result<Scene, ImportError> {
        import_slice(&self.glb(), &ImportOptions::default())
    }
}

/// Import within these limits.
pub(crate) fn limited(read: document::ReadOptions) -> ImportOptions {
    ImportOptions { read, ..ImportOptions::default() }
}
