//! Textures and vertex colours for the parts of a built scene.

use std::io::Cursor;

use glam::DVec3;
use image::{ImageFormat, RgbaImage};
use serde_json::{Value, json};

use crate::builder::{SceneBuilder, pack};

/// How an attribute's values are written.
#[derive(Debug, Clone, Copy)]
pub enum Numbers {
    /// As they are.
    Floats,
    /// 255 for 1.
    Bytes,
    /// 65,535 for 1.
    Shorts,
}

impl Numbers {
    /// Component type and bytes of a row, filled up to a multiple of four.
    fn write(self, row: &[f64]) -> (u32, Vec<u8>) {
        let (component, mut bytes): (u32, Vec<u8>) = match self {
            Self::Floats => (5126, row.iter().flat_map(|value| (*value as f32).to_le_bytes()).collect()),
            Self::Bytes => (5121, row.iter().map(|value| (value * 255.0).round() as u8).collect()),
            Self::Shorts => (
                5123,
                row.iter().flat_map(|value| ((value * 65_535.0).round() as u16).to_le_bytes()).collect(),
            ),
        };
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        (component, bytes)
    }
}

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
        self.coordinates_of_set(part, 0, coordinates)
    }

    /// The same for any set of coordinates.
    #[must_use]
    pub fn coordinates_of_set(self, part: usize, set: u32, coordinates: impl Fn(DVec3) -> [f64; 2]) -> Self {
        self.attribute(part, &format!("TEXCOORD_{set}"), Numbers::Floats, coordinates)
    }

    /// Gives the vertices of a part colours, with or without alpha, by their position.
    #[must_use]
    pub fn colours<const N: usize>(self, part: usize, colours: impl Fn(DVec3) -> [f64; N]) -> Self {
        self.colours_as(part, Numbers::Floats, colours)
    }

    /// The same in such numbers.
    #[must_use]
    pub fn colours_as<const N: usize>(
        self,
        part: usize,
        numbers: Numbers,
        colours: impl Fn(DVec3) -> [f64; N],
    ) -> Self {
        self.attribute(part, "COLOR_0", numbers, colours)
    }

    /// Adds a square image of these texels as a texture, and has its index put into the material of a part.
    ///
    /// # Panics
    /// When the texels are no square.
    #[must_use]
    pub fn texture(self, part: usize, texels: &[[u8; 4]], put: impl Fn(&mut Value, Value)) -> Self {
        let width = texels.len().isqrt() as u32;
        let image =
            RgbaImage::from_raw(width, width, texels.concat()).expect("as many texels as the square has");
        let mut bytes = Cursor::new(vec![]);
        image.write_to(&mut bytes, ImageFormat::Png).expect("memory can be written");
        self.encoded_texture(part, &bytes.into_inner(), ImageFormat::Png, put)
    }

    /// The same with an image that is encoded already.
    #[must_use]
    pub fn encoded_texture(
        mut self,
        part: usize,
        image: &[u8],
        format: ImageFormat,
        put: impl Fn(&mut Value, Value),
    ) -> Self {
        let view = self.view(image);
        let image = json!({ "bufferView": view, "mimeType": format.to_mime_type() });
        let source = push(&mut self.document, "images", image);
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

    fn attribute<const N: usize>(
        mut self,
        part: usize,
        name: &str,
        numbers: Numbers,
        value: impl Fn(DVec3) -> [f64; N],
    ) -> Self {
        let rows = self.positions(part).into_iter().map(|position| numbers.write(&value(position)));
        let (components, rows): (Vec<u32>, Vec<Vec<u8>>) = rows.unzip();
        let view = self.view(&rows.concat());
        self.document["bufferViews"][view]["byteStride"] = json!(rows[0].len());
        let shape = ["VEC2", "VEC3", "VEC4"][N - 2];
        let accessor = json!({
            "bufferView": view, "componentType": components[0], "normalized": components[0] != 5126,
            "count": rows.len(), "type": shape,
        });
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
