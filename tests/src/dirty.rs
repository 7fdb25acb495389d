//! A furnished room as careless tools write it, and the same room clean.

use std::f32::consts::TAU;

use glam::DVec3;
use serde_json::json;

use crate::builder::{Material, SceneBuilder, pack};
use crate::numbers::Numbers;
use crate::shapes::{Polygon, box_facing_in, box_facing_out};

/// The room's far corner; the near one is the origin. Metres, y up.
pub const ROOM: DVec3 = DVec3::new(6.0, 3.0, 4.0);

/// A wall through the room that is a millimetre thick.
const PARTITION: (DVec3, DVec3) = (DVec3::new(3.5, 0.0, 0.0), DVec3::new(3.501, 2.0, 2.5));

/// Furniture that passes through each other, through the floor and through walls.
const FURNITURE: [(DVec3, DVec3); 4] = [
    (DVec3::new(1.0, -0.2, 1.0), DVec3::new(2.0, 0.7, 2.0)),
    (DVec3::new(1.6, 0.3, 1.4), DVec3::new(2.6, 0.5, 2.6)),
    (DVec3::new(5.2, 0.1, 3.2), DVec3::new(6.3, 1.1, 4.2)),
    (DVec3::new(4.5, 0.0, 0.5), DVec3::new(5.0, 1.5, 1.0)),
];

/// The room with faces of one polygon each: what there is to see of the dirty one, but for its clutter.
#[must_use]
pub fn clean_room() -> SceneBuilder {
    room(|face| vec![face.clone()])
}

/// The same surfaces in about so many triangles: none shares a vertex with another, some come twice, some have no area, huge
/// ones stand beside tiny ones, three sheets meet at one edge, and a ball has smooth normals.
#[must_use]
pub fn dirty_room(triangles: usize) -> Vec<u8> {
    let mut numbers = Numbers::new(1);
    let faces = 6 * (2 + FURNITURE.len());
    let builder = room(|face| careless(face, triangles / faces, &mut numbers));
    // Three sheets of no thickness at one edge, above the lamp's height where they shade little.
    let hinge = [DVec3::new(4.0, 2.6, 3.0), DVec3::new(4.0, 2.9, 3.0)];
    let sheet = |x: f64, z: f64| {
        let across = DVec3::new(x, 0.0, z) * 0.2;
        vec![hinge[0], hinge[0] + across, hinge[1] + across, hinge[1]]
    };
    let sheets = [sheet(1.0, 0.0), sheet(-0.5, 0.8), sheet(-0.5, -0.8)];
    let builder = builder.part("sheets", &sheets, Material::grey(0.5).double_sided());
    with_ball(&builder)
}

/// Walls, partition, furniture and a lamp, their faces divided by `divide`.
fn room(mut divide: impl FnMut(&Polygon) -> Vec<Polygon>) -> SceneBuilder {
    let mut divided = |faces: Vec<Polygon>| faces.iter().flat_map(&mut divide).collect::<Vec<_>>();
    let mut builder = SceneBuilder::new()
        .part("walls", &divided(box_facing_in(DVec3::ZERO, ROOM)), Material::grey(0.6))
        .part("partition", &divided(box_facing_out(PARTITION.0, PARTITION.1)), Material::grey(0.5));
    for (index, (low, high)) in FURNITURE.into_iter().enumerate() {
        let faces = divided(box_facing_out(low, high));
        builder = builder.part(&format!("furniture {index}"), &faces, Material::grey(0.4));
    }
    let lamp =
        [[2.5, 2.99, 1.5], [3.3, 2.99, 1.5], [3.3, 2.99, 2.5], [2.5, 2.99, 2.5]].map(DVec3::from_array);
    builder.part("lamp", &[lamp.to_vec()], Material::grey(0.0).emitting(100.0))
}

/// A rectangle in about so many triangles of very different sizes, with duplicates and triangles without area among them.
fn careless(face: &Polygon, triangles: usize, numbers: &mut Numbers) -> Vec<Polygon> {
    // Lines at squares of a uniform grid: cells at one corner are tiny, those at the other huge.
    let cells = ((triangles as f64 / 2.0).sqrt() as usize).max(1);
    let line = |i: usize| (i as f64 / cells as f64).powi(2);
    let (origin, along, across) = (face[0], face[1] - face[0], face[3] - face[0]);
    // Rounded as the file will be, so that neighbours have the same corners.
    let point = |i: usize, j: usize| (origin + along * line(i) + across * line(j)).as_vec3().as_dvec3();
    let mut polygons = Vec::new();
    for i in 0..cells {
        for j in 0..cells {
            let [a, b, c, d] = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
            let halves = if numbers.part() < 0.5 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
            for half in halves {
                let kind = numbers.part();
                if kind < 0.02 {
                    // The same once more, from another corner.
                    polygons.push(vec![half[1], half[2], half[0]]);
                } else if kind < 0.03 {
                    polygons.push(vec![half[0], half[1], half[1]]);
                } else if kind < 0.04 {
                    polygons.push(vec![half[0], half[0].midpoint(half[1]), half[1]]);
                }
                polygons.push(half.to_vec());
            }
        }
    }
    polygons
}

/// Adds a ball with smooth normals, which the builder does not write.
fn with_ball(builder: &SceneBuilder) -> Vec<u8> {
    let (centre, radius, rings) = ([2.2f32, 1.2, 3.2], 0.25f32, 12u32);
    let direction = |ring: u32, segment: u32| {
        let (polar, turn) =
            (ring as f32 / rings as f32 * TAU / 2.0, segment as f32 / (2 * rings) as f32 * TAU);
        [polar.sin() * turn.sin(), polar.cos(), polar.sin() * turn.cos()]
    };
    let mut normals = Vec::new();
    for ring in 0..rings {
        for segment in 0..2 * rings {
            let [a, b, c, d] =
                [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(r, s)| direction(ring + r, segment + s));
            normals.extend([a, b, c, a, c, d]);
        }
    }
    let positions: Vec<[f32; 3]> =
        normals.iter().map(|n| std::array::from_fn(|axis| centre[axis] + radius * n[axis])).collect();
    let (mut document, mut binary) = builder.document();
    let mut add = |values: &[[f32; 3]]| {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
        let views = document["bufferViews"].as_array_mut().expect("the builder writes an array");
        views.push(json!({ "buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len() }));
        let view = views.len() - 1;
        binary.extend(bytes);
        let accessors = document["accessors"].as_array_mut().expect("the builder writes an array");
        accessors.push(json!({
            "bufferView": view, "componentType": 5126, "count": values.len(), "type": "VEC3",
            "min": [-100.0, -100.0, -100.0], "max": [100.0, 100.0, 100.0],
        }));
        accessors.len() - 1
    };
    let attributes = json!({ "POSITION": add(&positions), "NORMAL": add(&normals) });
    document["buffers"][0]["byteLength"] = binary.len().into();
    let material = document["materials"].as_array().map_or(0, Vec::len);
    let mesh = document["meshes"].as_array().map_or(0, Vec::len);
    let node = document["nodes"].as_array().map_or(0, Vec::len);
    let mut push = |array: &str, value| {
        document[array].as_array_mut().expect("the builder writes an array").push(value);
    };
    push(
        "materials",
        json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0 } }),
    );
    push("meshes", json!({ "primitives": [{ "attributes": attributes, "material": material }] }));
    push("nodes", json!({ "name": "ball", "mesh": mesh }));
    document["scenes"][0]["nodes"].as_array_mut().expect("the builder writes an array").push(json!(node));
    pack(&document, &binary)
}
