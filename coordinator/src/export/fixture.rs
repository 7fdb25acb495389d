//! Scenes for tests: documents made by hand, and the plainest import and lighting of them.

use std::collections::HashMap;
use std::path::PathBuf;

use glam::DVec3;
use serde_json::{Value, json};
use shared::geometry::PlaneId;

use crate::lit::{LitMesh, LitTriangle, LitVertex};
use crate::placement::world_matrices;
use crate::scene::{Corner, Facet, Frame, Scene, Side, SourceDocument, SourceTriangle, Surface};

/// A glTF document in the making, with one buffer.
#[derive(Default)]
pub(crate) struct Builder {
    pub(crate) bytes: Vec<u8>,
    pub(crate) views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Builder {
    /// Adds a buffer view and returns its index.
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()}));
        self.bytes.extend_from_slice(bytes);
        self.views.len() - 1
    }

    /// Adds an accessor of these fields over these bytes and returns its index.
    pub(crate) fn accessor(&mut self, bytes: &[u8], mut fields: Value) -> usize {
        fields["bufferView"] = self.view(bytes).into();
        self.accessors.push(fields);
        self.accessors.len() - 1
    }

    /// Adds an accessor of floats and returns its index.
    pub(crate) fn floats<const N: usize>(&mut self, rows: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = rows.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..N).map(|i| rows.iter().map(|row| row[i]).reduce(pick).unwrap()).collect()
        };
        let type_ = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let fields = json!({"componentType": 5126, "count": rows.len(), "type": type_,
            "min": bound(f32::min), "max": bound(f32::max)});
        self.accessor(&bytes, fields)
    }

    /// Adds an accessor of vertex indices and returns its index.
    pub(crate) fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        self.accessor(&bytes, json!({"componentType": 5123, "count": indices.len(), "type": "SCALAR"}))
    }

    /// The unit square in z = 0, facing +z: two triangles over four vertices.
    pub(crate) fn square(&mut self) -> Value {
        let positions = self.floats(&[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]]);
        let indices = self.indices(&[0, 1, 2, 0, 2, 3]);
        json!({"attributes": {"POSITION": positions}, "indices": indices})
    }

    /// The document and the bytes of its buffer.
    pub(crate) fn finish(self, mut root: Value) -> (Value, Vec<u8>) {
        root["asset"]["version"] = "2.0".into();
        root["buffers"] = json!([{"byteLength": self.bytes.len()}]);
        root["bufferViews"] = self.views.into();
        root["accessors"] = self.accessors.into();
        (root, self.bytes)
    }

    /// The document, imported.
    pub(crate) fn import(self, root: Value) -> Scene {
        let (root, bytes) = self.finish(root);
        let root = gltf::json::Root::from_str(&root.to_string()).unwrap();
        import(SourceDocument { root, buffers: vec![bytes], folder: None })
    }
}

/// A document of the project's test scenes.
pub(crate) fn test_scene(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/scenes").join(name)
}

/// A binary glTF, imported.
pub(crate) fn open(name: &str) -> Scene {
    let gltf = gltf::Gltf::open(test_scene(name)).unwrap();
    import(SourceDocument {
        root: gltf.document.into_json(),
        buffers: vec![gltf.blob.unwrap()],
        folder: None,
    })
}

/// One facet per triangle, and a frame that is not the world's. Two triangles on the same four vertices become one facet,
/// so that facets of several source triangles occur.
fn import(source: SourceDocument) -> Scene {
    let document = gltf::Document::from_json(source.root.clone()).unwrap();
    let frame = Frame { centre: DVec3::new(1.0, -2.0, 0.5), scale: 0.25 };
    let mut surfaces = Vec::new();
    for (node, world) in document.nodes().zip(world_matrices(&document)) {
        let primitives = node.mesh().into_iter().flat_map(|mesh| mesh.primitives());
        for primitive in primitives.filter(|primitive| primitive.mode() == gltf::mesh::Mode::Triangles) {
            let reader = primitive.reader(|buffer| source.buffers.get(buffer.index()).map(Vec::as_slice));
            let positions: Vec<DVec3> = reader
                .read_positions()
                .unwrap()
                .map(|p| frame.to_frame(world.transform_point3(DVec3::from_array(p.map(f64::from)))))
                .collect();
            let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
            let material = primitive.material();
            let pbr = material.pbr_metallic_roughness();
            let [r, g, b, _] = pbr.base_color_factor().map(f64::from);
            let sides =
                if material.double_sided() { vec![Side::Front, Side::Back] } else { vec![Side::Front] };
            for side in sides {
                let reversed = (side == Side::Back) != (world.determinant() < 0.0);
                surfaces.push(Surface {
                    node: node.index(),
                    primitive: primitive.index(),
                    side,
                    name: format!("{} ({side:?})", node.name().unwrap_or("node")),
                    reflectance: DVec3::new(r, g, b) * (1.0 - f64::from(pbr.metallic_factor())),
                    exitance: DVec3::from_array(material.emissive_factor().map(f64::from)),
                    opacity: 1.0,
                    appearance: None,
                    facets: facets(&positions, &indices, reversed),
                });
            }
        }
    }
    Scene {
        source,
        surfaces,
        lights: vec![],
        sky: DVec3::ZERO,
        frame,
        plane_count: 1,
        warnings: vec![],
        account: Default::default(),
        degenerate_triangles: 0,
    }
}

fn facets(positions: &[DVec3], indices: &[u32], reversed: bool) -> Vec<Facet> {
    let mut facets: Vec<Facet> = Vec::new();
    let mut triangles = indices.chunks_exact(3).map(|corners| {
        let vertices = if reversed {
            [corners[0], corners[2], corners[1]]
        } else {
            [corners[0], corners[1], corners[2]]
        };
        SourceTriangle { vertices, positions: vertices.map(|vertex| positions[vertex as usize]) }
    });
    while let Some(first) = triangles.next() {
        let [a, b, c] = first.positions;
        let normal = (b - a).cross(c - a).normalize();
        let mut members = vec![first];
        // The squares of these scenes come as (0, 1, 2), (0, 2, 3).
        let mut outline = vec![a, b, c];
        if let Some(second) = triangles.clone().next() {
            let shared = second.positions.iter().filter(|p| outline.contains(p)).count();
            let [d, e, f] = second.positions;
            if shared == 2 && (e - d).cross(f - d).normalize().dot(normal) > 1.0 - 1e-12 {
                triangles.next();
                members.push(second);
                outline = quadrilateral(&members);
            }
        }
        let corners = outline.into_iter().map(|position| Corner { position, normal }).collect();
        facets.push(Facet { plane: PlaneId(0), normal, corners, triangles: members });
    }
    facets
}

/// The outline of two triangles that share an edge: the first one's, with the second one's far corner in that edge.
fn quadrilateral(triangles: &[SourceTriangle]) -> Vec<DVec3> {
    let first = triangles[0].positions;
    let far = *triangles[1].positions.iter().find(|p| !first.contains(p)).unwrap();
    let shared = |p: &DVec3| triangles[1].positions.contains(p);
    let at = (0..3).find(|&i| shared(&first[i]) && shared(&first[(i + 1) % 3])).unwrap();
    vec![first[at], far, first[(at + 1) % 3], first[(at + 2) % 3]]
}

/// Lights the scene with an irradiance that depends on the world position: every facet a fan, every triangle of it divided
/// into four, `levels` times.
pub(crate) fn light(scene: &Scene, levels: u32, irradiance: impl Fn(DVec3) -> DVec3) -> LitMesh {
    let mut lit = LitMesh::default();
    for surface in &scene.surfaces {
        let mut triangles = Vec::new();
        for (index, facet) in surface.facets.iter().enumerate() {
            let mut known = HashMap::new();
            let mut vertex = |position: DVec3| {
                *known.entry(position.to_array().map(f64::to_bits)).or_insert_with(|| {
                    let irradiance = irradiance(scene.frame.to_world(position));
                    lit.vertices.push(LitVertex { position, normal: facet.normal, irradiance });
                    lit.vertices.len() as u32 - 1
                })
            };
            let corner = |i: usize| facet.corners[i].position;
            let mut pieces: Vec<[DVec3; 3]> =
                (1..facet.corners.len() - 1).map(|i| [corner(0), corner(i), corner(i + 1)]).collect();
            for _ in 0..levels {
                pieces = pieces.into_iter().flat_map(quarters).collect();
            }
            triangles.extend(
                pieces
                    .iter()
                    .map(|piece| LitTriangle { facet: index as u32, vertices: piece.map(&mut vertex) }),
            );
        }
        lit.surfaces.push(triangles);
    }
    lit
}

fn quarters([a, b, c]: [DVec3; 3]) -> [[DVec3; 3]; 4] {
    let (ab, bc, ca) = (a.midpoint(b), b.midpoint(c), c.midpoint(a));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
}

/// A scene of one square and its lit mesh, of uniform irradiance.
pub(crate) fn square() -> (Scene, LitMesh) {
    let mut builder = Builder::default();
    let square = builder.square();
    let scene = builder.import(json!({
        "meshes": [{"primitives": [square]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }));
    let lit = light(&scene, 0, |_| DVec3::ONE);
    (scene, lit)
}
