//! Small scenes, as the bytes of a GLB.

use std::borrow::Cow;
use std::f64::consts::PI;

use glam::{DMat4, DVec3};
use gltf::Glb;
use gltf::binary::Header;
use serde_json::{Value, json};

use crate::shapes::Polygon;

/// What a part's surfaces are made of; RGB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Diffuse reflectance.
    pub reflectance: DVec3,
    /// Emitted exitance, W/m^2: pi x radiance.
    pub exitance: DVec3,
    /// Whether both sides are lit.
    pub double_sided: bool,
}

impl Material {
    /// Reflects this part of the light and emits none.
    #[must_use]
    pub fn grey(reflectance: f64) -> Self {
        Self { reflectance: DVec3::splat(reflectance), exitance: DVec3::ZERO, double_sided: false }
    }

    /// Emits this exitance too.
    #[must_use]
    pub fn emitting(self, exitance: f64) -> Self {
        Self { exitance: DVec3::splat(exitance), ..self }
    }

    /// Lit on both sides.
    #[must_use]
    pub fn double_sided(self) -> Self {
        Self { double_sided: true, ..self }
    }

    fn to_json(self) -> Value {
        let [r, g, b] = self.reflectance.to_array();
        let mut material = json!({
            "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0 },
            "doubleSided": self.double_sided,
        });
        // Emissive factors end at 1: the largest of the three goes into the strength.
        let strength = self.exitance.max_element() / PI;
        if strength > 0.0 {
            material["emissiveFactor"] = json!((self.exitance / (PI * strength)).to_array());
            material["extensions"] =
                json!({ "KHR_materials_emissive_strength": { "emissiveStrength": strength } });
        }
        material
    }
}

/// A node with a mesh of one primitive.
#[derive(Debug, Clone)]
struct Part {
    name: String,
    material: Material,
    polygons: Vec<Polygon>,
    transform: DMat4,
}

/// A scene in the making.
///
/// Every part is a node with a mesh and a material of the same name, in the order in which they are added, so that the
/// surfaces of the imported scene stand in the same order. Lights are nodes after them.
#[derive(Debug, Clone, Default)]
pub struct SceneBuilder {
    parts: Vec<Part>,
    /// Lights as KHR_lights_punctual or EXT_lights_area have them.
    lights: Vec<Value>,
    /// Nodes that show one of them: where they stand, and which it is.
    lit_nodes: Vec<(DMat4, usize)>,
}

impl SceneBuilder {
    /// A scene without anything in it.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a part: polygons whose first corner sees all of each, convex or not, counter-clockwise seen from the lit side.
    /// They are written as fans of triangles around that corner.
    #[must_use]
    pub fn part(mut self, name: &str, polygons: &[Polygon], material: Material) -> Self {
        let polygons = polygons.to_vec();
        self.parts.push(Part { name: name.into(), material, polygons, transform: DMat4::IDENTITY });
        self
    }

    /// Places the node of the part that was added last.
    ///
    /// # Panics
    /// When there is none.
    #[must_use]
    pub fn placed(mut self, transform: DMat4) -> Self {
        self.parts.last_mut().expect("a part was added before it is placed").transform = transform;
        self
    }

    /// Places all parts and lights once more, on top of where they are. The lights' intensity does not change.
    #[must_use]
    pub fn all_placed(mut self, transform: DMat4) -> Self {
        for part in &mut self.parts {
            part.transform = transform * part.transform;
        }
        for (place, _) in &mut self.lit_nodes {
            *place = transform * *place;
        }
        self
    }

    /// Reverses the order of parts, and of the polygons in each: the same scene in another file.
    #[must_use]
    pub fn reversed(mut self) -> Self {
        self.parts.reverse();
        self.parts.iter_mut().for_each(|part| part.polygons.reverse());
        self.lit_nodes.reverse();
        self
    }

    /// Triangles of all parts.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.parts.iter().flat_map(|part| &part.polygons).map(|polygon| polygon.len() - 2).sum()
    }

    /// Adds an isotropic point light.
    #[must_use]
    pub fn point_light(self, position: DVec3, intensity: f64) -> Self {
        let light = json!({ "type": "point", "intensity": intensity, "color": [1.0, 1.0, 1.0] });
        self.light(light, DMat4::from_translation(position))
    }

    /// Adds a light, as KHR_lights_punctual or EXT_lights_area have it, at a node of its own and of its name; it shines along the
    /// node's -Z axis.
    #[must_use]
    pub fn light(mut self, light: Value, place: DMat4) -> Self {
        self.lights.push(light);
        self.same_light(place)
    }

    /// Adds one more node with the light that was added last.
    ///
    /// # Panics
    /// When there is none.
    #[must_use]
    pub fn same_light(mut self, place: DMat4) -> Self {
        let light = self.lights.len().checked_sub(1).expect("a light was added before it is shown again");
        self.lit_nodes.push((place, light));
        self
    }

    /// The document and the bytes of its only buffer, for tests that damage them.
    ///
    /// # Panics
    /// When a part has no polygon, or one with less than three corners: glTF has no such thing.
    #[must_use]
    pub fn document(&self) -> (Value, Vec<u8>) {
        let (mut binary, mut views, mut accessors) = (vec![], vec![], vec![]);
        let (mut meshes, mut materials, mut nodes) = (vec![], vec![], vec![]);
        for (index, part) in self.parts.iter().enumerate() {
            let positions: Vec<[f32; 3]> =
                part.polygons.iter().flat_map(fan).map(|p| p.as_vec3().into()).collect();
            assert!(!positions.is_empty(), "part {} has no polygon", part.name);
            let bound = |pick: fn(f32, f32) -> f32| {
                let each = |axis: usize| positions.iter().map(|p| p[axis]).reduce(pick);
                json!([each(0), each(1), each(2)])
            };
            accessors.push(json!({
                "bufferView": index, "componentType": 5126, "count": positions.len(), "type": "VEC3",
                "min": bound(f32::min), "max": bound(f32::max),
            }));
            let bytes: Vec<u8> = positions.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
            views.push(json!({ "buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len() }));
            binary.extend(bytes);
            let mut material = part.material.to_json();
            material["name"] = json!(part.name);
            materials.push(material);
            let primitive = json!({ "attributes": { "POSITION": index }, "material": index });
            meshes.push(json!({ "name": part.name, "primitives": [primitive] }));
            let mut node = json!({ "name": part.name, "mesh": index });
            if part.transform != DMat4::IDENTITY {
                node["matrix"] = json!(part.transform.to_cols_array());
            }
            nodes.push(node);
        }
        let mut document = json!({
            "asset": { "version": "2.0" },
            "scene": 0,
            "meshes": meshes,
            "materials": materials,
            "accessors": accessors,
            "bufferViews": views,
            "buffers": [{ "byteLength": binary.len() }],
        });
        let mut extensions = vec!["KHR_materials_emissive_strength"];
        let mut lists = json!({});
        for (place, light) in &self.lit_nodes {
            let own = &self.lights[*light];
            let extension = extension_of(own);
            let index = self.lights[..*light].iter().filter(|other| extension_of(other) == extension).count();
            let mut node = json!({ "extensions": { extension: { "light": index } } });
            if let Some(name) = own.get("name") {
                node["name"] = name.clone();
            }
            if own["type"] == "point" {
                node["translation"] = json!(place.w_axis.truncate().to_array());
            } else {
                node["matrix"] = json!(place.to_cols_array());
            }
            nodes.push(node);
            let own = self.lights.iter().filter(|other| extension_of(other) == extension);
            lists[extension] = json!({ "lights": own.collect::<Vec<_>>() });
        }
        if let Some(lists) = lists.as_object().filter(|lists| !lists.is_empty()) {
            extensions.extend(lists.keys().map(String::as_str));
            document["extensions"] = json!(lists);
        }
        document["extensionsUsed"] = json!(extensions);
        document["scenes"] = json!([{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }]);
        document["nodes"] = json!(nodes);
        (document, binary)
    }

    /// The scene as the bytes of a GLB.
    ///
    /// # Panics
    /// As [`Self::document`].
    #[must_use]
    pub fn glb(&self) -> Vec<u8> {
        let (document, binary) = self.document();
        pack(&document, &binary)
    }
}

/// A document and its buffer as the bytes of a GLB.
///
/// # Panics
/// Never: these lengths can be written.
#[must_use]
pub fn pack(document: &Value, binary: &[u8]) -> Vec<u8> {
    let header = Header { magic: *b"glTF", version: 2, length: 0 };
    let bin = (!binary.is_empty()).then_some(Cow::Borrowed(binary));
    Glb { header, json: document.to_string().into_bytes().into(), bin }
        .to_vec()
        .expect("it is far below 4 GiB")
}

/// The extension that has lights of this type.
fn extension_of(light: &Value) -> &'static str {
    match light["type"].as_str() {
        Some("rect" | "disk") => "EXT_lights_area",
        _ => "KHR_lights_punctual",
    }
}

/// A polygon as triangles around its first corner.
fn fan(polygon: &Polygon) -> impl Iterator<Item = DVec3> + '_ {
    assert!(polygon.len() >= 3, "a polygon has three corners or more");
    polygon[1..].windows(2).flat_map(|pair| [polygon[0], pair[0], pair[1]])
}
