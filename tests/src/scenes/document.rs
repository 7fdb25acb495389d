use std::collections::BTreeSet;

use glam::{DMat4, DVec3};
use serde_json::{Value, json};

use super::geometry::Geometry;
use crate::builder::pack;

/// A glTF document in the making.
#[derive(Default)]
pub struct Document {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    images: Vec<Value>,
    lights: Vec<Value>,
    cameras: Vec<Value>,
    nodes: Vec<Value>,
}

const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

impl Document {
    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.binary.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn floats<const N: usize>(&mut self, rows: &[[f32; N]], bounded: bool) -> usize {
        let bytes: Vec<u8> = rows.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(ARRAY_BUFFER));
        let shape = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let mut accessor =
            json!({ "bufferView": view, "componentType": 5126, "count": rows.len(), "type": shape });
        if bounded {
            let bound = |pick: fn(f32, f32) -> f32| -> Vec<Option<f32>> {
                (0..N).map(|axis| rows.iter().map(|row| row[axis]).reduce(pick)).collect()
            };
            (accessor["min"], accessor["max"]) = (json!(bound(f32::min)), json!(bound(f32::max)));
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn indices(&mut self, geometry: &Geometry) -> usize {
        let corners = geometry.triangles.as_flattened();
        let is_short = geometry.positions.len() <= usize::from(u16::MAX);
        let bytes: Vec<u8> = if is_short {
            corners.iter().flat_map(|corner| (*corner as u16).to_le_bytes()).collect()
        } else {
            corners.iter().flat_map(|corner| corner.to_le_bytes()).collect()
        };
        let view = self.view(&bytes, Some(ELEMENT_ARRAY_BUFFER));
        let component = if is_short { 5123 } else { 5125 };
        self.accessors.push(
            json!({ "bufferView": view, "componentType": component, "count": corners.len(), "type": "SCALAR" }),
        );
        self.accessors.len() - 1
    }

    /// Adds a PNG; what materials refer to it by.
    pub fn picture(&mut self, name: &str, png: &[u8]) -> Value {
        let view = self.view(png, None);
        self.images.push(json!({ "name": name, "bufferView": view, "mimeType": "image/png" }));
        json!({ "index": self.images.len() - 1 })
    }

    /// Adds a material: fields of the glTF, `pbr` those of its metallic-roughness part.
    pub fn material(&mut self, name: &str, pbr: Value, fields: Value) -> usize {
        let mut material = fields;
        material["name"] = json!(name);
        material["pbrMetallicRoughness"] = pbr;
        if material["pbrMetallicRoughness"].get("metallicFactor").is_none() {
            material["pbrMetallicRoughness"]["metallicFactor"] = json!(0.0);
        }
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Adds a material of one colour.
    pub fn paint(&mut self, name: &str, [red, green, blue]: [f64; 3]) -> usize {
        self.material(name, json!({ "baseColorFactor": [red, green, blue, 1.0] }), json!({}))
    }

    /// Adds a mesh of these pieces, each with its material.
    pub fn mesh(&mut self, name: &str, pieces: &[(&Geometry, usize)]) -> usize {
        let mut primitives = vec![];
        for (geometry, material) in pieces {
            let vectors =
                |vectors: &[DVec3]| vectors.iter().map(|v| v.as_vec3().to_array()).collect::<Vec<_>>();
            let mut attributes = json!({
                "POSITION": self.floats(&vectors(&geometry.positions), true),
                "NORMAL": self.floats(&vectors(&geometry.normals), false),
                "TEXCOORD_0": self.floats(
                    &geometry.places.iter().map(|place| place.as_vec2().to_array()).collect::<Vec<_>>(), false),
            });
            if !geometry.colours.is_empty() {
                attributes["COLOR_0"] = json!(self.floats(&vectors(&geometry.colours), false));
            }
            let indices = self.indices(geometry);
            primitives.push(json!({ "attributes": attributes, "indices": indices, "material": material }));
        }
        self.meshes.push(json!({ "name": name, "primitives": primitives }));
        self.meshes.len() - 1
    }

    /// Adds a node of the scene.
    pub fn node(&mut self, name: &str, place: DMat4, mut fields: Value) {
        fields["name"] = json!(name);
        if place == DMat4::from_translation(place.w_axis.truncate()) {
            fields["translation"] = json!(place.w_axis.truncate().as_vec3().to_array());
        } else {
            fields["matrix"] = json!(place.as_mat4().to_cols_array());
        }
        self.nodes.push(fields);
    }

    /// Shows a mesh.
    pub fn show(&mut self, name: &str, mesh: usize, place: DMat4) {
        self.node(name, place, json!({ "mesh": mesh }));
    }

    /// Adds one mesh and shows it where it was modelled.
    pub fn thing(&mut self, name: &str, geometry: &Geometry, material: usize) {
        let mesh = self.mesh(name, &[(geometry, material)]);
        self.show(name, mesh, DMat4::IDENTITY);
    }

    /// Adds a light, as KHR_lights_punctual has it, and a node that shines along its -Z axis.
    pub fn light(&mut self, name: &str, mut light: Value, place: DMat4) {
        light["name"] = json!(name);
        self.lights.push(light);
        self.light_again(name, place);
    }

    /// One more node with the light that was added last.
    pub fn light_again(&mut self, name: &str, place: DMat4) {
        let light = self.lights.len() - 1;
        self.node(name, place, json!({ "extensions": { "KHR_lights_punctual": { "light": light } } }));
    }

    /// Adds a camera with this vertical field of view, in radians, for pictures of 3 to 2.
    pub fn camera(&mut self, name: &str, eye: DVec3, target: DVec3, field: f64) {
        self.cameras.push(json!({
            "name": name, "type": "perspective",
            "perspective": { "yfov": field, "aspectRatio": 1.5, "znear": 0.05, "zfar": 200.0 },
        }));
        let camera = self.cameras.len() - 1;
        self.node(name, looking(eye, target), json!({ "camera": camera }));
    }

    /// The bytes of a GLB.
    pub fn glb(self) -> Vec<u8> {
        let mut root = json!({
            "asset": { "version": "2.0", "generator": "cargo run --release -p tests --example scenes" },
            "scene": 0,
            "scenes": [{ "nodes": (0..self.nodes.len()).collect::<Vec<_>>() }],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{ "byteLength": self.binary.len() }],
        });
        let mut extensions = BTreeSet::new();
        if !self.images.is_empty() {
            // Trilinear, repeated.
            root["samplers"] =
                json!([{ "magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497 }]);
            let textures = (0..self.images.len()).map(|image| json!({ "source": image, "sampler": 0 }));
            root["textures"] = textures.collect();
            root["images"] = json!(self.images);
        }
        if !self.cameras.is_empty() {
            root["cameras"] = json!(self.cameras);
        }
        if !self.lights.is_empty() {
            extensions.insert("KHR_lights_punctual".to_owned());
            root["extensions"] = json!({ "KHR_lights_punctual": { "lights": self.lights } });
        }
        for material in &self.materials {
            extensions.extend(
                material["extensions"].as_object().into_iter().flatten().map(|(name, _)| name.clone()),
            );
            let texture = &material["pbrMetallicRoughness"]["baseColorTexture"];
            extensions.extend(
                texture["extensions"].as_object().into_iter().flatten().map(|(name, _)| name.clone()),
            );
        }
        if !extensions.is_empty() {
            root["extensionsUsed"] = json!(extensions);
        }
        pack(&root, &self.binary)
    }
}

/// Where a node stands that looks, or shines, along its -Z axis at a target.
pub fn looking(eye: DVec3, target: DVec3) -> DMat4 {
    let back = (eye - target).normalize();
    let aside = if back.y.abs() > 0.999 { DVec3::X } else { DVec3::Y.cross(back).normalize() };
    DMat4::from_cols(aside.extend(0.0), back.cross(aside).extend(0.0), back.extend(0.0), eye.extend(1.0))
}

/// Turned about the vertical by so many degrees, and then moved.
pub fn standing(place: DVec3, degrees: f64) -> DMat4 {
    let (sine, cosine) = libm::sincos(degrees.to_radians());
    DMat4::from_cols(
        DVec3::new(cosine, 0.0, -sine).extend(0.0),
        DVec3::Y.extend(0.0),
        DVec3::new(sine, 0.0, cosine).extend(0.0),
        place.extend(1.0),
    )
}
