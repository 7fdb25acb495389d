//! Pictures of small files made by hand.
//!
//! | file | what it tests |
//! |---|---|
//! | `shown` | light, materials and textures |
//! | `views` | cameras and tiles |
//! | `files` | PNG and EXR |

mod files;
mod shown;
mod views;

use std::collections::VecDeque;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use glam::DVec3;
use kernel::picture::{
    Camera, FinishedTile, Projection, TileRequest, TileService, decode_pixels, encode_picture,
};
use kernel::replica::{Digest, EncodedReplica};
use serde_json::{Value, json};
use worker::store::{Replica, ReplicaStore};
use worker::tile::Tile;

use super::*;
use document::ReadOptions;
use kernel::row::JobId;

/// A worker without a network, that answers the latest job first.
struct Local {
    store: ReplicaStore,
    finished: VecDeque<FinishedTile>,
}

impl Default for Local {
    fn default() -> Self {
        Self { store: ReplicaStore::new(1 << 30), finished: VecDeque::new() }
    }
}

impl TileService for Local {
    type Error = std::convert::Infallible;

    fn publish(&mut self, replica: EncodedReplica) {
        let decoded = Replica::decode(replica.kind, &replica.bytes).unwrap();
        self.store.insert(replica.digest, decoded, replica.bytes.len() as u64);
    }

    fn release(&mut self, digest: Digest) {
        self.store.remove(digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, TileRequest)>) {
        for (job, request) in requests {
            let answer = Tile::new(&request.to_job(job.0), &mut self.store).unwrap().compute();
            let (pixels, _) = decode_pixels(&request, &answer).unwrap();
            self.finished.push_front(FinishedTile { job, pixels, rays: answer.rays, busy_nanoseconds: 0 });
        }
    }

    fn next(&mut self) -> Result<FinishedTile, Self::Error> {
        Ok(self.finished.pop_front().unwrap())
    }
}

/// A glTF in the making: squares of 2 x 2 in their planes z = 0.
struct Builder {
    json: Value,
    bytes: Vec<u8>,
}

const CORNERS: [[f32; 3]; 4] = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];

impl Builder {
    fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [] }], "nodes": [], "meshes": [],
            "materials": [], "accessors": [], "bufferViews": [], "cameras": [],
        });
        Self { json, bytes: vec![] }
    }

    fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let (offset, length) = (self.bytes.len(), values.len() * N * 4);
        self.bytes.extend(values.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
        let view =
            self.push("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": length }));
        let kind = format!("VEC{N}");
        let mut accessor =
            json!({ "bufferView": view, "componentType": 5126, "count": values.len(), "type": kind });
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..N).map(|at| values.iter().map(|value| value[at]).reduce(pick).unwrap()).collect()
        };
        (accessor["min"], accessor["max"]) = (json!(bound(f32::min)), json!(bound(f32::max)));
        self.push("accessors", accessor)
    }

    /// A square with these attributes beside its positions.
    fn square(&mut self, node: Value, material: Value, attributes: &[(&str, usize)]) {
        let fan = [0, 1, 2, 0, 2, 3].map(|corner| CORNERS[corner]);
        let mut all = json!({ "POSITION": self.floats(&fan) });
        attributes.iter().for_each(|(name, accessor)| all[name] = json!(accessor));
        let material = self.push("materials", material);
        let mesh =
            self.push("meshes", json!({ "primitives": [{ "attributes": all, "material": material }] }));
        let mut node = node;
        node["mesh"] = json!(mesh);
        self.node(node);
    }

    /// One value per corner of a square.
    fn corners<const N: usize>(&mut self, values: [[f32; N]; 4]) -> usize {
        self.floats(&[0, 1, 2, 0, 2, 3].map(|corner| values[corner]))
    }

    fn node(&mut self, node: Value) {
        let node = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
    }

    fn camera(&mut self, name: &str, translation: [f64; 3], camera: Value) {
        let camera = self.push("cameras", camera);
        self.node(json!({ "name": name, "translation": translation, "scale": [3, 3, 3], "camera": camera }));
    }

    fn read(mut self) -> LitFile {
        let data = BASE64_STANDARD.encode(&self.bytes);
        let uri = format!("data:application/octet-stream;base64,{data}");
        self.json["buffers"] = json!([{ "byteLength": self.bytes.len(), "uri": uri }]);
        let lists = self.json.as_object_mut().unwrap();
        lists.retain(|_, list| list != &json!([]));
        let folder = tempfile::tempdir().unwrap();
        let path: PathBuf = folder.path().join("lit.gltf");
        std::fs::write(&path, self.json.to_string()).unwrap();
        read_lit(&path, &ReadOptions::default()).unwrap()
    }
}

fn unlit(base: [f64; 4]) -> Value {
    json!({
        "pbrMetallicRoughness": { "baseColorFactor": base, "metallicFactor": 0 },
        "extensions": { "KHR_materials_unlit": {} },
    })
}

/// A picture of the 2 x 2 square around the origin from z = 5, by parallel rays.
fn front(file: &LitFile, size: [u32; 2], background: DVec3) -> Picture {
    let camera = Camera {
        eye: file.frame.to_frame(DVec3::Z * 5.0),
        right: DVec3::X,
        up: DVec3::Y,
        forward: DVec3::NEG_Z,
        projection: Projection::Parallel { half: [1.0 / file.frame.scale; 2] },
        near: 0.0,
    };
    take(file, camera, size, background)
}

fn take(file: &LitFile, camera: Camera, size: [u32; 2], background: DVec3) -> Picture {
    let settings = TileSettings { camera, size, samples: 1, background };
    render_tiles(&mut Local::default(), encode_picture(&file.scene), &settings, &mut |_, _| ()).unwrap()
}

fn at(picture: &Picture, x: u32, y: u32) -> DVec3 {
    DVec3::from_array(picture.pixels[(y * picture.size[0] + x) as usize].map(f64::from))
}

fn assert_near(found: DVec3, expected: [f64; 3]) {
    assert!((found - DVec3::from_array(expected)).abs().max_element() < 1e-5, "{found} {expected:?}");
}
