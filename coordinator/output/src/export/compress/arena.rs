//! The new buffer: compressed bytes, then what other views hold.

use std::collections::BTreeMap;

use gltf::json::accessor::{ComponentType, GenericComponentType};
use gltf::json::buffer::{Stride, Target, View};
use gltf::json::validation::Checked::Valid;
use gltf::json::{Buffer, Index, Root, extensions};
use serde_json::json;

use super::super::ExportError;
use super::super::buffer::{pad, retain, view_references};
use super::stream::{Elements, Kind, Mode, encode};

/// The extension that names compressed views.
const MESHOPT: &str = "EXT_meshopt_compression";

/// The extension that allows directions of integers.
const QUANTIZATION: &str = "KHR_mesh_quantization";

/// Elements of accessors, by how they are encoded: all of a kind come in one view, since each costs a paragraph of JSON.
#[derive(Default)]
pub(super) struct Arena {
    groups: BTreeMap<Kind, Group>,
}

/// Elements of one kind.
#[derive(Default)]
struct Group {
    bytes: Vec<u8>,
    count: usize,
    /// The accessors, and where the elements of each begin.
    accessors: Vec<(usize, usize)>,
}

impl Arena {
    /// Gives an accessor these elements.
    pub(super) fn put(&mut self, root: &mut Root, accessor: usize, elements: Elements) {
        let Elements { kind, component, bytes, count } = elements;
        let group = self.groups.entry(kind).or_default();
        group.accessors.push((accessor, group.count));
        group.bytes.extend(bytes);
        group.count += count;
        let accessor = &mut root.accessors[accessor];
        accessor.component_type = Valid(GenericComponentType(component));
        accessor.normalized = component == ComponentType::I16;
        accessor.count = count.into();
    }

    /// Puts the elements into a new buffer, with what other views of the old one hold.
    pub(super) fn finish(
        self,
        root: &mut Root,
        binary: Vec<u8>,
        pinned: usize,
    ) -> Result<Vec<u8>, ExportError> {
        if self.groups.is_empty() {
            return Ok(binary);
        }
        let mut joined = vec![];
        // Length of the buffer that stands for what is decoded.
        let mut decoded = 0;
        let mut is_quantized = false;
        for (kind, group) in self.groups {
            let encoded = encode(kind, &group.bytes)?;
            pad(&mut joined);
            let view = root.push(view(kind, group.count, [joined.len(), encoded.len()], decoded));
            joined.extend(encoded);
            decoded = (decoded + group.count * kind.stride).next_multiple_of(4);
            is_quantized |= kind.filter == Some("OCTAHEDRAL");
            for (accessor, first) in group.accessors {
                let accessor = &mut root.accessors[accessor];
                accessor.buffer_view = Some(view);
                accessor.byte_offset = (first > 0).then(|| (first * kind.stride).into());
            }
        }
        let views = std::mem::take(&mut root.buffer_views);
        root.buffer_views = retain(views, view_references(root), |index| index < pinned)?;
        for (index, view) in root.buffer_views.iter_mut().enumerate() {
            if view.buffer.value() == 0 {
                let start = view.byte_offset.map_or(0, |offset| offset.0 as usize);
                let bytes = binary.get(start..).and_then(|rest| rest.get(..view.byte_length.0 as usize));
                let bytes = bytes.ok_or_else(|| ExportError::Buffer(format!("buffer view {index}")))?;
                pad(&mut joined);
                view.byte_offset = Some(joined.len().into());
                joined.extend_from_slice(bytes);
            }
        }
        pad(&mut joined);
        let buffer = |length: usize| Buffer {
            byte_length: length.into(),
            name: None,
            uri: None,
            extensions: None,
            extras: None,
        };
        let mut fallback = extensions::buffer::Buffer::default();
        fallback.others.insert(MESHOPT.into(), json!({ "fallback": true }));
        root.buffers = vec![buffer(joined.len()), Buffer { extensions: Some(fallback), ..buffer(decoded) }];
        for name in [Some(MESHOPT), is_quantized.then_some(QUANTIZATION)].into_iter().flatten() {
            root.extensions_used.push(name.into());
            root.extensions_required.push(name.into());
        }
        root.extensions_used.sort();
        Ok(joined)
    }
}

/// The view of a stream that has this place and length in the new buffer, and another in what it is decoded to.
fn view(kind: Kind, count: usize, [start, length]: [usize; 2], decoded: usize) -> View {
    let Kind { mode, filter, stride } = kind;
    let mut compressed = json!({
        "buffer": 0, "byteOffset": start, "byteLength": length, "byteStride": stride, "count": count, "mode": mode.name(),
    });
    if let Some(filter) = filter {
        compressed["filter"] = json!(filter);
    }
    let mut extensions = extensions::buffer::View::default();
    extensions.others.insert(MESHOPT.into(), compressed);
    let is_vertices = mode == Mode::Attributes;
    View {
        buffer: Index::new(1),
        byte_length: (count * stride).into(),
        byte_offset: Some(decoded.into()),
        byte_stride: is_vertices.then_some(Stride(stride)),
        name: None,
        target: Some(Valid(if is_vertices { Target::ArrayBuffer } else { Target::ElementArrayBuffer })),
        extensions: Some(extensions),
        extras: None,
    }
}
