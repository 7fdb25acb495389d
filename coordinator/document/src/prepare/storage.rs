//! One more buffer for what is decoded, within a limit.

use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::buffer::{Stride, Target, View};
use gltf::json::validation::Checked::{self, Valid};
use gltf::json::{Accessor, Buffer, Index, Root, Value};

use super::Limits;
use crate::accessors::most_zeros;
use crate::error::ImportProblem;

/// Buffer views start at multiples of this.
const ALIGNMENT: usize = 4;

/// A document whose decoded parts go to a new last buffer.
pub(super) struct Storage<'a> {
    /// The document.
    pub root: &'a mut Root,
    /// What is left of the limits.
    pub limits: Limits,
    buffers: &'a mut Vec<Vec<u8>>,
    bytes: Vec<u8>,
}

impl<'a> Storage<'a> {
    pub(super) fn new(root: &'a mut Root, buffers: &'a mut Vec<Vec<u8>>, limits: Limits) -> Self {
        Self { root, limits, buffers, bytes: Vec::new() }
    }

    /// Adds the buffer to the document, if there is anything in it.
    pub(super) fn finish(self) {
        if self.bytes.is_empty() {
            return;
        }
        self.root.buffers.push(Buffer {
            byte_length: self.bytes.len().into(),
            name: None,
            uri: None,
            extensions: None,
            extras: None,
        });
        self.buffers.push(self.bytes);
    }

    /// Takes bytes out of the limit, before they are allocated.
    pub(super) fn charge(&mut self, bytes: Option<usize>) -> Result<(), ImportProblem> {
        let left = bytes.and_then(|bytes| self.limits.bytes.checked_sub(bytes as u64));
        self.limits.bytes = left.ok_or(ImportProblem::TooLarge { limit: self.limits.max_bytes })?;
        Ok(())
    }

    /// Most elements of an accessor without data.
    pub(super) fn most_zeros(&self) -> u64 {
        most_zeros(self.buffers) + self.bytes.len() as u64
    }

    /// A part of a buffer, the new one included.
    pub(super) fn part(&self, buffer: usize, offset: usize, length: usize) -> Option<&[u8]> {
        let bytes = if buffer == self.buffers.len() { &self.bytes } else { self.buffers.get(buffer)? };
        bytes.get(offset..offset.checked_add(length)?)
    }

    /// The bytes of a view.
    pub(super) fn view(&self, view: &View) -> Option<&[u8]> {
        let offset = view.byte_offset.map_or(0, |offset| offset.0);
        self.part(
            view.buffer.value(),
            usize::try_from(offset).ok()?,
            usize::try_from(view.byte_length.0).ok()?,
        )
    }

    /// Stores bytes, whose room is charged already, and gives the view that they are.
    pub(super) fn store(
        &mut self,
        bytes: &[u8],
        stride: Option<Stride>,
        target: Option<Checked<Target>>,
    ) -> View {
        self.bytes.resize(self.bytes.len().next_multiple_of(ALIGNMENT), 0);
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        View {
            buffer: Index::new(self.buffers.len() as u32),
            byte_length: bytes.len().into(),
            byte_offset: Some(offset.into()),
            byte_stride: stride,
            name: None,
            target,
            extensions: None,
            extras: None,
        }
    }

    /// Adds a float accessor of vertex attributes, `width` numbers per vertex, with bounds. Charges for itself.
    pub(super) fn floats(&mut self, values: &[f32], width: usize) -> Result<Accessor, ImportProblem> {
        self.charge(values.len().checked_mul(4))?;
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let view = self.store(&bytes, None, Some(Valid(Target::ArrayBuffer)));
        let (min, max) = bounds(values, width);
        Ok(Accessor {
            buffer_view: Some(self.root.push(view)),
            byte_offset: None,
            count: (values.len() / width).into(),
            component_type: Valid(GenericComponentType(ComponentType::F32)),
            extensions: None,
            extras: None,
            type_: Valid(match width {
                1 => Type::Scalar,
                2 => Type::Vec2,
                3 => Type::Vec3,
                _ => Type::Vec4,
            }),
            min: Some(min),
            max: Some(max),
            name: None,
            normalized: false,
            sparse: None,
        })
    }
}

/// Smallest and largest value of each component. Values that are not finite are reported when positions are read.
fn bounds(values: &[f32], width: usize) -> (Value, Value) {
    let (mut low, mut high) = (vec![f32::MAX; width], vec![f32::MIN; width]);
    for row in values.chunks_exact(width) {
        for (axis, &value) in row.iter().enumerate() {
            low[axis] = low[axis].min(value);
            high[axis] = high[axis].max(value);
        }
    }
    (low.into(), high.into())
}
