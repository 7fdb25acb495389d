//! Textures and vertex colours for the parts of a built scene.

use std::io::Cursor;

use glam::DVec3;
use image::{ImageFormat, RgbaImage};
use serde_json::{Value, json};

use crate::builder::{SceneBuilder, pack};

/// A scene whose parts are being painted.
pub struct Painting {
    document: Value,
    binary: Vec<u8>,
}

impl Painting {
    /// Of a scene as it is built. Its images show their texels with edges, not interpolated.
    #[must_use]
    pub fn new(builder: &SceneBuilder) -> Self {
        let (mut document, binary) = builder.document();
        document["images"] = json!([]);
        document["textures"] = json!([]);
        document["samplers"] = json!([{ "magFilter": 9728 }]);
        Self { document, binary }
    }

    /// Gives the vertices of a part texture coordinates, by their position.
    #[must_use]
    pub fn coordinates(self, part: usize, coordinates: impl Fn(DVec3) -> [f64; 2]) -> Self {
        self.attribute(part, "TEXCOORD_0", "VEC2", |position| coordinates(position).to_vec())
    }

    /// Gives the vertices of a part colours with alpha, by their position.
    #[must_use]
    pub fn colours(self, part: usize, colours: impl Fn(DVec3) -> [f64; 4]) -> Self {
        self.attribute(part, "COLOR_0", "VEC4", |position| colours(position).to_vec())
    }

    /// Adds a square image of these texels as a texture, and has its index put into the material of a part.
    ///
    /// # Panics
    /// When the texels are no square.
    #[must_use]
    pub fn texture(mut self, part: usize, texels: &[[u8; 4]], put: impl Fn(&mut Value, Value)) -> Self {
        let width = texels.len().isqrt() as u32;
        let image =
            RgbaImage::from_raw(width, width, texels.concat()).expect("as many texels as the square has");
        let mut bytes = Cursor::new(vec![]);
        image.write_to(&mut bytes, ImageFormat::Png).expect("memory can be written");
        let view = self.view(&bytes.into_inner());
        let source =
            push(&mut self.document, "images", json!({ "bufferView": view, "mimeType": "image/png" }));
        let texture = push(&mut self.document, "textures", json!({ "source": source, "sampler": 0 }));
        put(&mut self.document["materials"][part], json!({ "index": texture }));
        self
    }

    /// Changes the material of a part.
    #[must_use]
    pub fn material(mut self, part: usize, change: impl Fn(&mut Value)) -> Self {
        change(&mut self.document["materials"][part]);
        self
    }

    /// The scene as the bytes of a GLB.
    #[must_use]
    pub fn glb(mut self) -> Vec<u8> {
        self.document["buffers"] = json!([{ "byteLength": self.binary.len() }]);
        pack(&self.document, &self.binary)
    }

    fn attribute(mut self, part: usize, name: &str, shape: &str, value: impl Fn(DVec3) -> Vec<f64>) -> Self {
        let values: Vec<Vec<f64>> = self.positions(part).into_iter().map(value).collect();
        let count = values.len();
        let bytes: Vec<u8> = values.into_iter().flatten().flat_map(|v| (v as f32).to_le_bytes()).collect();
        let view = self.view(&bytes);
        let accessor = json!({ "bufferView": view, "componentType": 5126, "count": count, "type": shape });
        let accessor = push(&mut self.document, "accessors", accessor);
        self.document["meshes"][part]["primitives"][0]["attributes"][name] = json!(accessor);
        self
    }

    /// Positions of a part's vertices: its accessor and view have the part's index.
    fn positions(&self, part: usize) -> Vec<DVec3> {
        let view = &self.document["bufferViews"][part];
        let range = |key: &str| view[key].as_u64().unwrap_or(0) as usize;
        let bytes = &self.binary[range("byteOffset")..][..range("byteLength")];
        let floats: Vec<f64> =
            bytes.as_chunks::<4>().0.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes))).collect();
        floats.as_chunks::<3>().0.iter().map(|position| DVec3::from_array(*position)).collect()
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        let view = json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() });
        self.binary.extend_from_slice(bytes);
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        push(&mut self.document, "bufferViews", view)
    }
}

fn push(document: &mut Value, array: &str, value: Value) -> usize {
    let values = document[array].as_array_mut().expect("an array of the document");
    values.push(value);
    values.len() - 1
}
