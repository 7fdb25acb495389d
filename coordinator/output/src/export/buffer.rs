//! The output's buffer: new accessors in, unused old ones out.

use std::mem;

use gltf::Semantic;
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::buffer::{Target, View};
use gltf::json::validation::Checked::Valid;
use gltf::json::{Accessor, Buffer, Index, Root, Value};

use super::ExportError;

/// Every buffer view starts at a multiple of it: the largest component has four bytes.
const ALIGNMENT: usize = 4;

/// Data of new accessors. Their views name a buffer one past the document's own, until [`gather`] joins all buffers.
pub(super) struct NewData {
    buffer: Index<Buffer>,
    bytes: Vec<u8>,
}

impl NewData {
    /// For a document with this number of buffers.
    pub(super) fn new(buffers: usize) -> Self {
        Self { buffer: Index::new(buffers as u32), bytes: Vec::new() }
    }

    /// Adds a vertex attribute of `width` components; positions get the bounds that the format demands.
    pub(super) fn push_attribute(
        &mut self,
        root: &mut Root,
        semantic: &Semantic,
        width: usize,
        values: &[f32],
    ) -> Index<Accessor> {
        let type_ = match width {
            1 => Type::Scalar,
            2 => Type::Vec2,
            3 => Type::Vec3,
            _ => Type::Vec4,
        };
        let mut accessor = accessor(ComponentType::F32, type_, values.len() / width);
        if *semantic == Semantic::Positions {
            let bound = |pick: fn(f32, f32) -> f32| -> Value {
                (0..width)
                    .filter_map(|i| values.iter().skip(i).step_by(width).copied().reduce(pick))
                    .collect()
            };
            accessor.min = Some(bound(f32::min));
            accessor.max = Some(bound(f32::max));
        }
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.push(root, bytes, Target::ArrayBuffer, accessor)
    }

    /// Adds vertex indices, in 16 bits where these suffice.
    pub(super) fn push_indices(
        &mut self,
        root: &mut Root,
        indices: &[u32],
        vertices: usize,
    ) -> Index<Accessor> {
        // 65535 itself restarts a primitive.
        let (component, bytes) = if vertices <= usize::from(u16::MAX) {
            (ComponentType::U16, indices.iter().flat_map(|&index| (index as u16).to_le_bytes()).collect())
        } else {
            (ComponentType::U32, indices.iter().flat_map(|index| index.to_le_bytes()).collect())
        };
        self.push(root, bytes, Target::ElementArrayBuffer, accessor(component, Type::Scalar, indices.len()))
    }

    /// Adds the bytes of an accessor, in a view of their own.
    fn push(
        &mut self,
        root: &mut Root,
        bytes: Vec<u8>,
        target: Target,
        accessor: Accessor,
    ) -> Index<Accessor> {
        let view = self.push_view(root, bytes, Some(target));
        root.push(Accessor { buffer_view: Some(view), ..accessor })
    }

    /// Adds a buffer view of these bytes.
    pub(super) fn push_view(
        &mut self,
        root: &mut Root,
        bytes: Vec<u8>,
        target: Option<Target>,
    ) -> Index<View> {
        pad(&mut self.bytes);
        let view = root.push(View {
            buffer: self.buffer,
            byte_length: bytes.len().into(),
            byte_offset: Some(self.bytes.len().into()),
            byte_stride: None,
            name: None,
            target: target.map(Valid),
            extensions: None,
            extras: None,
        });
        self.bytes.extend(bytes);
        view
    }
}

/// An accessor at the start of its view, which it still lacks.
fn accessor(component: ComponentType, type_: Type, count: usize) -> Accessor {
    Accessor {
        buffer_view: None,
        byte_offset: None,
        count: count.into(),
        component_type: Valid(GenericComponentType(component)),
        extensions: None,
        extras: None,
        type_: Valid(type_),
        min: None,
        max: None,
        name: None,
        normalized: false,
        sparse: None,
    }
}

/// Drops the accessors and buffer views that nothing names any more and joins the rest in one buffer, which it returns. The
/// first `pinned` of either stay where they are.
///
/// # Errors
/// When a view lies outside its buffer, or the buffer becomes larger than the format's 4 GiB.
pub(super) fn gather(
    root: &mut Root,
    buffers: &[Vec<u8>],
    new: NewData,
    pinned: usize,
) -> Result<Vec<u8>, ExportError> {
    let buffers: Vec<&[u8]> = buffers.iter().map(Vec::as_slice).chain([new.bytes.as_slice()]).collect();
    let accessors = mem::take(&mut root.accessors);
    root.accessors = retain(accessors, accessor_references(root), |index| index < pinned)?;
    let views = mem::take(&mut root.buffer_views);
    root.buffer_views = retain(views, view_references(root), |index| index < pinned)?;

    let mut joined = Vec::new();
    for (index, view) in root.buffer_views.iter_mut().enumerate() {
        let start = view.byte_offset.map_or(0, |offset| offset.0 as usize);
        let bytes = start
            .checked_add(view.byte_length.0 as usize)
            .and_then(|end| buffers.get(view.buffer.value())?.get(start..end))
            .ok_or_else(|| ExportError::Buffer(format!("buffer view {index}")))?;
        pad(&mut joined);
        view.buffer = Index::new(0);
        view.byte_offset = Some(joined.len().into());
        joined.extend_from_slice(bytes);
    }
    pad(&mut joined);
    if joined.len() > u32::MAX as usize {
        return Err(ExportError::TooLarge(joined.len()));
    }
    root.buffers.clear();
    if !joined.is_empty() {
        root.push(Buffer {
            byte_length: joined.len().into(),
            name: None,
            uri: None,
            extensions: None,
            extras: None,
        });
    }
    Ok(joined)
}

/// Keeps what is referred to, or what `keep` wants by its index, and lets the references follow it.
///
/// # Errors
/// When a reference names an item that does not exist.
pub(super) fn retain<T>(
    items: Vec<T>,
    references: Vec<&mut Index<T>>,
    keep: impl Fn(usize) -> bool,
) -> Result<Vec<T>, ExportError> {
    let mut kept: Vec<bool> = (0..items.len()).map(keep).collect();
    for reference in &references {
        *kept
            .get_mut(reference.value())
            .ok_or_else(|| ExportError::Mismatch(format!("the document has no object {reference}")))? = true;
    }
    let moved: Vec<u32> = kept
        .iter()
        .scan(0, |next, &kept| {
            let index = *next;
            *next += u32::from(kept);
            Some(index)
        })
        .collect();
    for reference in references {
        *reference = Index::new(moved[reference.value()]);
    }
    Ok(items.into_iter().zip(kept).filter_map(|(item, kept)| kept.then_some(item)).collect())
}

/// Everything in the document that names an accessor.
fn accessor_references(root: &mut Root) -> Vec<&mut Index<Accessor>> {
    let mut references = Vec::new();
    for primitive in root.meshes.iter_mut().flat_map(|mesh| &mut mesh.primitives) {
        references.extend(primitive.attributes.values_mut());
        references.extend(primitive.indices.as_mut());
        for target in primitive.targets.iter_mut().flatten() {
            let attributes = [&mut target.positions, &mut target.normals, &mut target.tangents];
            references.extend(attributes.into_iter().flatten());
        }
    }
    for sampler in root.animations.iter_mut().flat_map(|animation| &mut animation.samplers) {
        references.extend([&mut sampler.input, &mut sampler.output]);
    }
    references.extend(root.skins.iter_mut().filter_map(|skin| skin.inverse_bind_matrices.as_mut()));
    references
}

/// Everything in the document that names a buffer view.
pub(super) fn view_references(root: &mut Root) -> Vec<&mut Index<View>> {
    let mut references = Vec::new();
    for accessor in &mut root.accessors {
        references.extend(accessor.buffer_view.as_mut());
        if let Some(sparse) = &mut accessor.sparse {
            references.extend([&mut sparse.indices.buffer_view, &mut sparse.values.buffer_view]);
        }
    }
    references.extend(root.images.iter_mut().filter_map(|image| image.buffer_view.as_mut()));
    references
}

pub(super) fn pad(bytes: &mut Vec<u8>) {
    bytes.resize(bytes.len().next_multiple_of(ALIGNMENT), 0);
}
