//! EXT_mesh_gpu_instancing: every instance becomes a child node, which is lit by itself.

use std::collections::BTreeMap;

use gltf::json::Index;
use gltf::json::scene::{Node, UnitQuaternion};

use super::extensions::Extensions;
use super::storage::Storage;
use super::values::{self, Values};
use crate::error::ImportProblem;

/// Bytes charged per node.
const NODE_BYTES: usize = 1024;

/// Gives the nodes' meshes to children in the places of the instances.
pub(super) fn place(storage: &mut Storage, extensions: &Extensions) -> Result<(), ImportProblem> {
    for (&index, attributes) in &extensions.instances {
        let Some(node) = storage.root.nodes.get(index) else { continue };
        let (Some(mesh), name) = (node.mesh, node.name.clone()) else { continue };
        let weights = node.weights.clone();
        let place = || match &name {
            Some(name) => format!("the instances of node \"{name}\""),
            None => format!("the instances of node {index}"),
        };
        let transforms = Transforms::read(storage, attributes, &place)?;
        let Some(count) = transforms.count(&place)? else { continue };
        storage.charge(count.checked_mul(NODE_BYTES))?;
        let mut children = Vec::with_capacity(count);
        for instance in 0..count {
            children.push(storage.root.push(Node {
                mesh: Some(mesh),
                name: name.as_ref().map(|name| format!("{name}/{instance}")),
                weights: weights.clone(),
                ..transforms.node(instance)
            }));
        }
        let node = &mut storage.root.nodes[index];
        (node.mesh, node.skin, node.weights) = (None, None, None);
        if !children.is_empty() {
            node.children.get_or_insert_default().extend::<Vec<Index<Node>>>(children);
        }
    }
    Ok(())
}

/// The instances' transforms, as far as they are given.
struct Transforms {
    translation: Option<Values>,
    rotation: Option<Values>,
    scale: Option<Values>,
}

impl Transforms {
    fn read(
        storage: &mut Storage,
        attributes: &BTreeMap<String, usize>,
        place: &dyn Fn() -> String,
    ) -> Result<Self, ImportProblem> {
        let mut read = |name: &str, width: usize| {
            let Some(&index) = attributes.get(name) else { return Ok(None) };
            let what = || format!("{name} of {}", place());
            let index = u32::try_from(index).unwrap_or(u32::MAX);
            let values = values::read(storage, Index::new(index), &what)?;
            if values.width != width {
                let detail = format!("it has {} components in place of {width}", values.width);
                return Err(ImportProblem::Undecodable { place: what(), detail });
            }
            Ok(Some(values))
        };
        Ok(Self {
            translation: read("TRANSLATION", 3)?,
            rotation: read("ROTATION", 4)?,
            scale: read("SCALE", 3)?,
        })
    }

    /// Number of instances; `None` without any transform, where there is but the node itself.
    fn count(&self, place: &dyn Fn() -> String) -> Result<Option<usize>, ImportProblem> {
        let mut counts =
            [&self.translation, &self.rotation, &self.scale].into_iter().flatten().map(Values::len);
        let Some(count) = counts.next() else { return Ok(None) };
        if counts.all(|other| other == count) {
            return Ok(Some(count));
        }
        let detail = "its attributes differ in their number of elements".to_owned();
        Err(ImportProblem::Undecodable { place: place(), detail })
    }

    fn node(&self, instance: usize) -> Node {
        Node {
            translation: self.translation.as_ref().and_then(|values| row(values, instance)),
            rotation: self.rotation.as_ref().and_then(|values| row(values, instance)).map(UnitQuaternion),
            scale: self.scale.as_ref().and_then(|values| row(values, instance)),
            ..Node::default()
        }
    }
}

fn row<const N: usize>(values: &Values, instance: usize) -> Option<[f32; N]> {
    values.numbers.get(instance * N..)?.first_chunk().copied()
}
