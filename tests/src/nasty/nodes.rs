//! Scenes whose nodes are the trouble.

use glam::{DMat4, DQuat, DVec3};
use serde_json::{Value, json};

use super::{ROOM, material, room};
use crate::numbers::Numbers;
use crate::shapes::box_facing_out;

/// Triangles of the box that is repeated.
const BOX: usize = 12;

/// A room with a small box, whose mesh the nodes share: the document, its buffer, the triangles of the room, and the node of the box.
fn with_box(numbers: &mut Numbers) -> (Value, Vec<u8>, usize, usize) {
    let half = numbers.magnitude(1e-3, 0.2);
    let material = material(numbers);
    let builder =
        room(numbers).part("box", &box_facing_out(DVec3::splat(-half), DVec3::splat(half)), material);
    let (document, binary) = builder.document();
    let node = document["nodes"].as_array().map_or(0, Vec::len) - 1;
    (document, binary, builder.triangles() - BOX, node)
}

/// A chain of nodes, each a step on from the one before, some with a box.
pub(super) fn chain(numbers: &mut Numbers, triangles: usize) -> (Value, Vec<u8>, usize) {
    let (mut document, binary, of_room, first) = with_box(numbers);
    let length = numbers.magnitude(2.0, triangles as f64 + 2.0) as usize;
    let boxes = (triangles / BOX).max(1);
    let step = 2.0 / length as f64;
    let grows = numbers.of(&[1.0, 1.0, 0.99, 1.01, -1.0]);
    let mesh = document["nodes"][first]["mesh"].clone();
    let mut shown = 0;
    let mut nodes = document["nodes"].as_array().cloned().unwrap_or_default();
    nodes[first]["translation"] = json!([0.5, 0.5, 0.5]);
    for index in 0..length {
        let turn = DQuat::from_axis_angle(numbers.direction(), numbers.magnitude(1e-6, 0.1));
        let scale = if index < 60 { grows } else { 1.0 };
        let mut node = json!({
            "translation": (step * numbers.direction().abs() * 0.5).to_array(),
            "rotation": turn.to_array(),
            "scale": [scale, 1.0, 1.0],
        });
        if shown < boxes && numbers.chance(boxes as f64 / length as f64) {
            node["mesh"] = mesh.clone();
            shown += 1;
        }
        let parent = if index == 0 { first } else { nodes.len() - 1 };
        nodes[parent]["children"] = json!([nodes.len()]);
        nodes.push(node);
    }
    document["nodes"] = nodes.into();
    (document, binary, of_room + (shown + 1) * BOX)
}

/// Nodes that share a mesh: mirrored, squeezed flat, on one another; as nodes, or as instances of one.
pub(super) fn instances(numbers: &mut Numbers, triangles: usize) -> (Value, Vec<u8>, usize) {
    let (mut document, mut binary, of_room, first) = with_box(numbers);
    let count = (numbers.magnitude(1.0, (triangles / BOX).max(2) as f64) as usize).max(1);
    let same = numbers.chance(0.2);
    let mut placed = Vec::new();
    for _ in 0..count {
        let at = if same { ROOM / 2.0 } else { numbers.point(DVec3::splat(0.3), ROOM - 0.3) };
        let turn = if same {
            DQuat::IDENTITY
        } else {
            DQuat::from_axis_angle(numbers.direction(), numbers.between(0.0, 6.0))
        };
        let mut part = || numbers.of(&[1.0, 1.0, 1.0, -1.0, 0.5, 1e-3, 1e-7]);
        placed.push((at, turn, DVec3::new(part(), part(), part())));
    }
    let mesh = document["nodes"][first]["mesh"].clone();
    let mut nodes = document["nodes"].as_array().cloned().unwrap_or_default();
    if numbers.chance(0.5) {
        let roots = document["scenes"][0]["nodes"].as_array().cloned().unwrap_or_default();
        let all = roots.into_iter().chain((0..count).map(|index| json!(nodes.len() + index)));
        document["scenes"][0]["nodes"] = all.collect();
        for (at, turn, scale) in placed {
            let matrix = DMat4::from_scale_rotation_translation(scale, turn, at);
            nodes.push(json!({ "mesh": mesh, "matrix": matrix.to_cols_array() }));
        }
        // The box itself stands in the middle of the room, too.
        nodes[first]["translation"] = json!([1.5, 1.5, 0.5]);
        document["nodes"] = nodes.into();
        return (document, binary, of_room + (count + 1) * BOX);
    }
    let mut attribute = |name: &str, type_: &str, rows: Vec<Vec<f32>>| {
        let bytes: Vec<u8> = rows.concat().into_iter().flat_map(f32::to_le_bytes).collect();
        let views = document["bufferViews"].as_array_mut().expect("the builder writes an array");
        views.push(json!({ "buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len() }));
        let view = views.len() - 1;
        binary.extend(bytes);
        let accessors = document["accessors"].as_array_mut().expect("the builder writes an array");
        accessors
            .push(json!({ "bufferView": view, "componentType": 5126, "count": rows.len(), "type": type_ }));
        (name.to_owned(), json!(accessors.len() - 1))
    };
    let floats = |vector: &[f64]| vector.iter().map(|value| *value as f32).collect::<Vec<f32>>();
    let attributes: serde_json::Map<String, Value> = [
        attribute("TRANSLATION", "VEC3", placed.iter().map(|(at, ..)| floats(&at.to_array())).collect()),
        attribute("ROTATION", "VEC4", placed.iter().map(|(_, turn, _)| floats(&turn.to_array())).collect()),
        attribute("SCALE", "VEC3", placed.iter().map(|(.., scale)| floats(&scale.to_array())).collect()),
    ]
    .into_iter()
    .collect();
    nodes[first]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
    document["nodes"] = nodes.into();
    document["buffers"][0]["byteLength"] = binary.len().into();
    let mut used = document["extensionsUsed"].as_array().cloned().unwrap_or_default();
    used.push("EXT_mesh_gpu_instancing".into());
    document["extensionsUsed"] = used.into();
    (document, binary, of_room + count * BOX)
}
