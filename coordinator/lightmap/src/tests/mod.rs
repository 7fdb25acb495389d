//! What plans of small scenes are like.

mod charts;
mod texels;

use std::f64::consts::PI;

use glam::DVec3;
use scene::{ImportOptions, Scene, import_slice};
use serde_json::{Value, json};

use crate::Resolution;
use crate::plan::{Plan, plan};

/// A mesh of a scene.
#[derive(Clone, Default)]
struct Part {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    second_set: Vec<[f32; 2]>,
    indices: Vec<u32>,
    is_double_sided: bool,
}

impl Part {
    /// A square from a corner along two edges.
    fn square(corner: [f32; 3], u: [f32; 3], v: [f32; 3]) -> Self {
        let at = |a: f32, b: f32| [0, 1, 2].map(|i| corner[i] + a * u[i] + b * v[i]);
        let positions = vec![at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
        Self { positions, indices: vec![0, 1, 2, 0, 2, 3], ..Self::default() }
    }

    /// A square on the ground.
    fn floor(size: f32) -> Self {
        Self::square([0.0; 3], [0.0, 0.0, size], [size, 0.0, 0.0])
    }

    /// The walls and the lid of a box on the ground, facing out.
    fn lid(low: [f32; 2], high: [f32; 2], height: f32) -> Self {
        let ([x, z], [dx, dz]) = (low, [high[0] - low[0], high[1] - low[1]]);
        let up = [0.0, height, 0.0];
        let squares = [
            Self::square([x, 0.0, z], up, [dx, 0.0, 0.0]),
            Self::square([x, 0.0, high[1]], [dx, 0.0, 0.0], up),
            Self::square([x, 0.0, z], [0.0, 0.0, dz], up),
            Self::square([high[0], 0.0, z], up, [0.0, 0.0, dz]),
            Self::square([x, height, z], [0.0, 0.0, dz], [dx, 0.0, 0.0]),
        ];
        let mut all = Self::default();
        for square in squares {
            let first = all.positions.len() as u32;
            all.indices.extend(square.indices.iter().map(|index| first + index));
            all.positions.extend(square.positions);
        }
        all
    }

    /// The same with flat facets.
    fn flat(self) -> Self {
        let positions: Vec<[f32; 3]> =
            self.indices.iter().map(|index| self.positions[*index as usize]).collect();
        let indices = (0..positions.len() as u32).collect();
        Self { positions, indices, ..Self::default() }
    }

    /// A ball with smooth normals.
    fn ball(rings: u32, sectors: u32) -> Self {
        let mut ball = Self::default();
        for ring in 0..=rings {
            for sector in 0..sectors {
                let (polar, turn) = (
                    PI * f64::from(ring) / f64::from(rings),
                    2.0 * PI * f64::from(sector) / f64::from(sectors),
                );
                let normal = DVec3::new(polar.sin() * turn.cos(), polar.cos(), -polar.sin() * turn.sin());
                ball.positions.push(normal.as_vec3().to_array());
                ball.normals.push(normal.as_vec3().to_array());
                if ring < rings {
                    let (here, next) = (ring * sectors + sector, ring * sectors + (sector + 1) % sectors);
                    ball.indices.extend([here, here + sectors, next + sectors]);
                    ball.indices.extend([here, next + sectors, next]);
                }
            }
        }
        ball
    }
}

/// A scene of these meshes under a white sky.
fn scene(parts: &[Part]) -> Scene {
    scene_of(parts, &(0..parts.len()).map(|mesh| json!({ "mesh": mesh })).collect::<Vec<_>>())
}

/// A scene of nodes that show these meshes.
fn scene_of(parts: &[Part], nodes: &[Value]) -> Scene {
    let (mut bytes, mut views, mut accessors) = (vec![], vec![], vec![]);
    let mut push = |data: Vec<u8>, accessor: Value| {
        views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": data.len() }));
        let mut accessor = accessor;
        accessor["bufferView"] = json!(views.len() - 1);
        accessors.push(accessor);
        bytes.extend(data);
        accessors.len() - 1
    };
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let mut meshes = vec![];
    for part in parts {
        let count = part.positions.len();
        let mut attributes = json!({});
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..3).map(|i| part.positions.iter().map(|p| p[i]).reduce(pick).unwrap()).collect()
        };
        let vectors = json!({ "componentType": 5126, "count": count, "type": "VEC3" });
        let mut positions = vectors.clone();
        (positions["min"], positions["max"]) = (json!(bound(f32::min)), json!(bound(f32::max)));
        attributes["POSITION"] = json!(push(floats(part.positions.as_flattened()), positions));
        if !part.normals.is_empty() {
            attributes["NORMAL"] = json!(push(floats(part.normals.as_flattened()), vectors));
        }
        if !part.second_set.is_empty() {
            let pairs = json!({ "componentType": 5126, "count": count, "type": "VEC2" });
            let set = json!(push(floats(part.second_set.as_flattened()), pairs));
            (attributes["TEXCOORD_0"], attributes["TEXCOORD_1"]) = (set.clone(), set);
        }
        let indices = part.indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        let scalars = json!({ "componentType": 5125, "count": part.indices.len(), "type": "SCALAR" });
        let indices = push(indices, scalars);
        let material = usize::from(part.is_double_sided);
        meshes.push(
            json!({ "primitives": [{ "attributes": attributes, "indices": indices, "material": material }] }),
        );
    }
    let document = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
        "nodes": nodes, "meshes": meshes, "materials": [{}, { "doubleSided": true }], "accessors": accessors, "bufferViews": views,
        "buffers": [{ "byteLength": bytes.len() }],
    });
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((28 + json.len() as u32 + bytes.len() as u32).to_le_bytes());
    file.extend((json.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(json);
    file.extend((bytes.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(bytes);
    import_slice(&file, &ImportOptions { sky: DVec3::ONE, ..ImportOptions::default() }).unwrap()
}

fn planned(parts: &[Part], resolution: Resolution) -> Plan {
    plan(&scene(parts), resolution, &|| false).unwrap()
}
