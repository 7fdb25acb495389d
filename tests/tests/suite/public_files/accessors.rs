use bake::BakeSettings;
use glam::DVec3;
use serde_json::{Value, json};
use tests::baking::{baked, imported};
use tests::builder::{Material, SceneBuilder, pack};
use tests::shapes::box_facing_out;

/// A strip of six squares, of which three corners of the upper line are drawn out, some of them far.
const LINE: u16 = 7;
const DRAWN: [(u16, [f32; 3]); 3] = [(8, [1.0, 2.0, 0.3]), (10, [3.0, 3.0, 0.6]), (12, [5.0, 4.0, 0.9])];

fn strip() -> (Vec<[f32; 3]>, Vec<u16>) {
    let positions = (0..2 * LINE).map(|i| [f32::from(i % LINE), f32::from(i / LINE), 0.0]).collect();
    let squares = (0..LINE - 1).flat_map(|i| [i, i + LINE + 1, i + LINE, i, i + 1, i + LINE + 1]);
    (positions, squares.collect())
}

/// A document in the making, of one mesh under two lights.
struct File {
    document: Value,
    binary: Vec<u8>,
}

impl File {
    fn new() -> Self {
        let (mut document, binary) = SceneBuilder::new()
            .part("thing", &box_facing_out(DVec3::ZERO, DVec3::ONE), Material::grey(0.5).double_sided())
            .point_light(DVec3::new(2.0, -1.0, 3.0), 20.0)
            .point_light(DVec3::new(6.0, 5.0, -2.0), 70.0)
            .document();
        for array in ["accessors", "bufferViews"] {
            document[array] = json!([]);
        }
        drop(binary);
        Self { document, binary: vec![] }
    }

    fn push(&mut self, array: &str, value: Value) -> usize {
        let values = self.document[array].as_array_mut().unwrap();
        values.push(value);
        values.len() - 1
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let view = json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() });
        self.binary.extend_from_slice(bytes);
        self.push("bufferViews", view)
    }

    fn vectors(&mut self, vectors: &[[f32; 3]]) -> usize {
        let view = self.view(&bytes(vectors));
        self.push("accessors", vector_accessor(view, 0, vectors.len()))
    }

    fn indices(&mut self, indices: &[u16]) -> usize {
        let list: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        self.index_accessor(&list, 5123, indices.len())
    }

    fn index_accessor(&mut self, list: &[u8], component: u32, count: usize) -> usize {
        let view = self.view(list);
        let accessor =
            json!({ "bufferView": view, "componentType": component, "count": count, "type": "SCALAR" });
        self.push("accessors", accessor)
    }

    /// The bits of what comes out of a bake: positions and irradiance.
    fn light(mut self, primitive: Value) -> Vec<[u64; 6]> {
        self.document["meshes"][0]["primitives"][0] = primitive;
        self.document["meshes"][0]["primitives"][0]["material"] = json!(0);
        self.document["buffers"] = json!([{ "byteLength": self.binary.len() }]);
        let scene = imported(&pack(&self.document, &self.binary));
        let settings = BakeSettings { mesh_error: 0.05, validation_samples: 0, ..BakeSettings::default() };
        let lit = baked(&scene, &settings).lit;
        assert!(lit.vertices.iter().any(|vertex| vertex.irradiance.x > 0.0));
        let bits = |vertex: &bake::lit::LitVertex| {
            let [p, e] =
                [vertex.position, vertex.irradiance].map(|vector| vector.to_array().map(f64::to_bits));
            [p[0], p[1], p[2], e[0], e[1], e[2]]
        };
        lit.vertices.iter().map(bits).collect()
    }
}

fn bytes(vectors: &[[f32; 3]]) -> Vec<u8> {
    vectors.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn vector_accessor(view: usize, offset: usize, count: usize) -> Value {
    json!({
        "bufferView": view, "byteOffset": offset, "componentType": 5126, "count": count, "type": "VEC3",
        "min": [-10.0, -10.0, -10.0], "max": [10.0, 10.0, 10.0],
    })
}

/// The strip with the drawn corners where they belong.
fn dense() -> Vec<[u64; 6]> {
    let (mut positions, indices) = strip();
    DRAWN.into_iter().for_each(|(corner, place)| positions[usize::from(corner)] = place);
    let mut file = File::new();
    let (positions, indices) = (file.vectors(&positions), file.indices(&indices));
    file.light(json!({ "attributes": { "POSITION": positions }, "indices": indices }))
}

fn sparse(file: &mut File, accessor: usize, replaced: &[(u16, [f32; 3])]) {
    let corners: Vec<u8> = replaced.iter().flat_map(|(corner, _)| corner.to_le_bytes()).collect();
    let places: Vec<[f32; 3]> = replaced.iter().map(|(_, place)| *place).collect();
    let (corners, places) = (file.view(&corners), file.view(&bytes(&places)));
    file.document["accessors"][accessor]["sparse"] = json!({
        "count": replaced.len(),
        "indices": { "bufferView": corners, "componentType": 5123 },
        "values": { "bufferView": places },
    });
}

/// Three positions replaced, and all of them written over an accessor without data, which is zeros.
#[test]
fn sparse_positions_are_those_of_the_dense_file() {
    let dense = dense();
    let (mut positions, indices) = strip();
    let mut file = File::new();
    let (accessor, list) = (file.vectors(&positions), file.indices(&indices));
    sparse(&mut file, accessor, &DRAWN);
    assert!(file.light(json!({ "attributes": { "POSITION": accessor }, "indices": list })) == dense);

    DRAWN.into_iter().for_each(|(corner, place)| positions[usize::from(corner)] = place);
    let all: Vec<(u16, [f32; 3])> =
        (0..).zip(positions.iter().copied()).filter(|(_, p)| *p != [0.0; 3]).collect();
    let mut file = File::new();
    let (accessor, list) = (file.vectors(&positions), file.indices(&indices));
    file.document["accessors"][accessor].as_object_mut().unwrap().remove("bufferView");
    file.document["accessors"][accessor].as_object_mut().unwrap().remove("byteOffset");
    sparse(&mut file, accessor, &all);
    assert!(file.light(json!({ "attributes": { "POSITION": accessor }, "indices": list })) == dense);
}

/// Positions and normals in turn in one buffer view, as BoxInterleaved has them.
#[test]
fn interleaved_vertices_are_those_side_by_side() {
    let (mut positions, indices) = strip();
    DRAWN.into_iter().for_each(|(corner, place)| positions[usize::from(corner)] = place);
    let normals: Vec<[f32; 3]> =
        (0..14).map(|i: u8| [0.6 * f32::from(i % 2), 0.0, 1.0 - 0.2 * f32::from(i % 2)]).collect();
    let mut file = File::new();
    let (p, n, list) = (file.vectors(&positions), file.vectors(&normals), file.indices(&indices));
    let apart = file.light(json!({ "attributes": { "POSITION": p, "NORMAL": n }, "indices": list }));

    let mut file = File::new();
    let turns: Vec<[f32; 3]> = normals.iter().zip(&positions).flat_map(|(n, p)| [*n, *p]).collect();
    let view = file.view(&bytes(&turns));
    file.document["bufferViews"][view]["byteStride"] = json!(24);
    let n = file.push("accessors", vector_accessor(view, 0, normals.len()));
    let p = file.push("accessors", vector_accessor(view, 12, normals.len()));
    let list = file.indices(&indices);
    let interleaved = file.light(json!({ "attributes": { "POSITION": p, "NORMAL": n }, "indices": list }));
    assert!(interleaved == apart);
}

/// Indices of one, two and four bytes, a strip and a fan of triangles: the same mesh.
#[test]
fn indices_and_modes_of_every_kind() {
    let (mut positions, indices) = strip();
    DRAWN.into_iter().for_each(|(corner, place)| positions[usize::from(corner)] = place);
    let dense = dense();
    let light = |list: Vec<u8>, component: u32| {
        let mut file = File::new();
        let accessor = file.vectors(&positions);
        let list = file.index_accessor(&list, component, indices.len());
        file.light(json!({ "attributes": { "POSITION": accessor }, "indices": list }))
    };
    assert!(light(indices.iter().map(|index| *index as u8).collect(), 5121) == dense);
    assert!(light(indices.iter().flat_map(|index| u32::from(*index).to_le_bytes()).collect(), 5125) == dense);

    let shown = |mode: u32, corners: &[u16]| {
        let mut file = File::new();
        let accessor = file.vectors(&positions);
        let list = file.indices(corners);
        file.light(json!({ "attributes": { "POSITION": accessor }, "indices": list, "mode": mode }))
    };
    // The fan of corner 0 over the upper line, wound as fans are: the corner last.
    let fan: Vec<u16> = [0].into_iter().chain((LINE..2 * LINE).rev()).collect();
    let listed: Vec<u16> = fan[1..].windows(2).flat_map(|pair| [pair[0], pair[1], 0]).collect();
    assert!(shown(6, &fan) == shown(4, &listed));
    let zigzag: Vec<u16> = (0..LINE).flat_map(|i| [i + LINE, i]).collect();
    let listed: Vec<u16> = (0..zigzag.len() - 2)
        .flat_map(|i| {
            if i % 2 == 0 {
                [zigzag[i], zigzag[i + 1], zigzag[i + 2]]
            } else {
                [zigzag[i], zigzag[i + 2], zigzag[i + 1]]
            }
        })
        .collect();
    assert!(shown(5, &zigzag) == shown(4, &listed));
}
