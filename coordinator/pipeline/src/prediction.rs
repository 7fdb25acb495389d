//! The least memory that a scene takes, by what its file says.

use std::collections::BTreeMap;

use serde::Deserialize;

/// Bytes that a triangle takes at least while a scene is read and baked: those of a flat floor, which all become one facet, take
/// 360, and others more.
const BYTES_PER_TRIANGLE: u64 = 256;

/// Bytes of a GLB before its JSON.
const BEFORE_JSON: usize = 20;

/// Returns the memory that a bake of the default scene of this file takes at least, in bytes: that of the file and of its triangles, a
/// mesh counting once per node. Just the file's where it cannot be read: the import says why.
#[must_use]
pub fn least_memory_bytes(file: &[u8]) -> u64 {
    let triangles = json_of(file).and_then(|json| serde_json::from_slice::<Parts>(json).ok());
    let triangles = triangles.map_or(0, |parts| parts.triangles());
    triangles.saturating_mul(BYTES_PER_TRIANGLE).saturating_add(file.len() as u64)
}

fn json_of(file: &[u8]) -> Option<&[u8]> {
    if !file.starts_with(b"glTF") {
        return Some(file);
    }
    let length = u32::from_le_bytes(*file.get(12..)?.first_chunk()?) as usize;
    file.get(BEFORE_JSON..)?.get(..length)
}

/// What of a document tells its number of triangles.
#[derive(Deserialize, Default)]
#[serde(default)]
struct Parts {
    scene: usize,
    scenes: Vec<ScenePart>,
    nodes: Vec<NodePart>,
    meshes: Vec<MeshPart>,
    accessors: Vec<AccessorPart>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct ScenePart {
    nodes: Vec<usize>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct NodePart {
    mesh: Option<usize>,
    children: Vec<usize>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct MeshPart {
    primitives: Vec<PrimitivePart>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct PrimitivePart {
    indices: Option<usize>,
    attributes: BTreeMap<String, usize>,
    mode: Option<u32>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct AccessorPart {
    count: u64,
}

impl Parts {
    fn triangles(&self) -> u64 {
        let of_meshes: Vec<u64> = self.meshes.iter().map(|mesh| self.triangles_of(mesh)).collect();
        let mut stack: Vec<usize> = self.scenes.get(self.scene).map_or(vec![], |scene| scene.nodes.clone());
        let mut seen = vec![false; self.nodes.len()];
        let mut all = 0u64;
        while let Some(index) = stack.pop() {
            let Some(node) = self.nodes.get(index) else { continue };
            if std::mem::replace(&mut seen[index], true) {
                continue;
            }
            all = all.saturating_add(node.mesh.and_then(|mesh| of_meshes.get(mesh)).copied().unwrap_or(0));
            stack.extend(&node.children);
        }
        all
    }

    fn triangles_of(&self, mesh: &MeshPart) -> u64 {
        let of = |primitive: &PrimitivePart| {
            let accessor = primitive.indices.or_else(|| primitive.attributes.get("POSITION").copied());
            let corners = accessor.and_then(|index| self.accessors.get(index)).map_or(0, |own| own.count);
            match primitive.mode.unwrap_or(4) {
                4 => corners / 3,
                5 | 6 => corners.saturating_sub(2),
                _ => 0,
            }
        };
        mesh.primitives.iter().map(of).fold(0, u64::saturating_add)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn triangles_are_counted_once_per_node() {
        let file = json!({
            "scenes": [{ "nodes": [] }, { "nodes": [0, 2] }], "scene": 1,
            "nodes": [{ "mesh": 0, "children": [1] }, { "mesh": 0 }, { "mesh": 1 }, { "mesh": 1 }],
            "meshes": [
                { "primitives": [{ "indices": 0, "attributes": { "POSITION": 1 } }, { "mode": 1, "indices": 0 }] },
                { "primitives": [{ "mode": 5, "attributes": { "POSITION": 1 } }] },
            ],
            "accessors": [{ "count": 300 }, { "count": 12 }],
        })
        .to_string();
        let expected = (2 * 100 + 10) * BYTES_PER_TRIANGLE + file.len() as u64;
        assert_eq!(least_memory_bytes(file.as_bytes()), expected);
        let mut glb = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
        glb.extend((file.len() as u32).to_le_bytes());
        glb.extend(b"JSON");
        glb.extend(file.as_bytes());
        assert_eq!(least_memory_bytes(&glb), expected + 20);
    }

    #[test]
    fn what_is_no_document_takes_what_it_has() {
        let cyclic = json!({ "scenes": [{ "nodes": [0] }], "nodes": [{ "children": [0] }] }).to_string();
        let wrong = json!({ "nodes": 3 }).to_string();
        for file in [
            &b""[..],
            b"glTF",
            b"glTF\x02\0\0\0\0\0\0\0\xff\xff\xff\xffJSON{}",
            cyclic.as_bytes(),
            wrong.as_bytes(),
        ] {
            assert_eq!(least_memory_bytes(file), file.len() as u64);
        }
    }
}
