//! A copy of the input document whose lit nodes get other meshes.

use std::collections::BTreeSet;
use std::path::Path;

use gltf::Semantic;
use gltf::json::animation::Property;
use gltf::json::validation::Checked::Valid;
use gltf::json::{Index, Mesh, Root};

use super::buffer::{self, NewData};
use super::materials::complete_texture_transforms;
use super::{ExportError, Unshared, extensions, images};
use scene::{Scene, Surface};

/// The output before it is written.
pub(super) struct Assembled {
    pub(super) root: Root,
    /// The bytes of its only buffer.
    pub(super) binary: Vec<u8>,
    /// Vertices of the lit primitives.
    pub(super) vertices: usize,
    /// Triangles of the lit primitives.
    pub(super) triangles: usize,
    /// What light at vertices costs where several nodes show one mesh.
    pub(super) unshared: Option<Unshared>,
    /// Warnings on what could not be kept.
    pub(super) warnings: Vec<String>,
}

/// The output while its meshes change.
pub(super) struct Draft<'a> {
    pub(super) scene: &'a Scene,
    /// The input, to read from while the output changes.
    pub(super) document: gltf::Document,
    pub(super) root: Root,
    pub(super) new: NewData,
    /// Meshes of the input whose places are not free.
    taken_meshes: BTreeSet<usize>,
    /// Vertices of the lit primitives.
    pub(super) vertices: usize,
    /// Triangles of the lit primitives.
    pub(super) triangles: usize,
}

impl<'a> Draft<'a> {
    /// The input, of which these nodes will be lit.
    pub(super) fn new(scene: &'a Scene, is_lit: impl Fn(usize) -> bool) -> Self {
        let root = scene.source.root.clone();
        // A mesh that an unlit node shows as well must stay as it is.
        let unlit = root.nodes.iter().enumerate().filter(|(node, _)| !is_lit(*node));
        let taken_meshes = unlit.filter_map(|(_, node)| node.mesh).map(|mesh| mesh.value()).collect();
        Self {
            scene,
            document: gltf::Document::from_json_without_validation(root.clone()),
            new: NewData::new(scene.source.buffers.len()),
            root,
            taken_meshes,
            vertices: 0,
            triangles: 0,
        }
    }

    /// Gives a node a mesh of its own, or none, in place of the input's.
    pub(super) fn put(&mut self, node: usize, source: Index<Mesh>, mesh: Mesh) {
        let place = if mesh.primitives.is_empty() {
            None
        } else if self.taken_meshes.insert(source.value()) {
            // The first takes the place of the input's mesh: what names it by its index then means the lit one.
            self.root.meshes[source.value()] = mesh;
            Some(source)
        } else {
            Some(self.root.push(mesh))
        };
        let node = &mut self.root.nodes[node];
        (node.mesh, node.skin, node.weights) = (place, None, None);
    }

    /// Gathers the buffer of the output, for a file at this path. `is_lit` as in [`Self::new`].
    pub(super) fn finish(
        self,
        is_lit: impl Fn(usize) -> bool,
        output: &Path,
    ) -> Result<Assembled, ExportError> {
        let Self { scene, mut root, mut new, vertices, triangles, .. } = self;
        end_shape_animations(&mut root, is_lit);
        complete_texture_transforms(&mut root);
        let warnings = images::embed(&mut root, &scene.source, output, &mut new)?;
        let pinned = extensions::pinned(&scene.source.root)?;
        let binary = buffer::gather(&mut root, &scene.source.buffers, new, pinned)?;
        Ok(Assembled { root, binary, vertices, triangles, unshared: None, warnings })
    }
}

/// The primitive of the input that a surface was made of, in this mesh.
///
/// # Errors
/// When there is none.
pub(super) fn source_primitive<'d>(
    document: &'d gltf::Document,
    mesh: Index<Mesh>,
    surface: &Surface,
) -> Result<gltf::Primitive<'d>, ExportError> {
    let mesh = document.meshes().nth(mesh.value());
    mesh.and_then(|mesh| mesh.primitives().nth(surface.primitive))
        .ok_or_else(|| ExportError::Mismatch(format!("{} has no primitive", surface.name)))
}

/// The mesh of a node of the input, in the pose and with the expression that the light was computed with.
///
/// # Errors
/// When the node has none.
pub(super) fn posed(input: &Root, node: usize) -> Result<(Index<Mesh>, Mesh), ExportError> {
    let missing = || ExportError::Mismatch(format!("node {node} has no mesh"));
    let source = input.nodes.get(node).and_then(|node| node.mesh).ok_or_else(missing)?;
    let mut mesh: Mesh = input.get(source).ok_or_else(missing)?.clone();
    mesh.weights = None;
    for primitive in &mut mesh.primitives {
        primitive.targets = None;
        primitive
            .attributes
            .retain(|name, _| !matches!(name, Valid(Semantic::Joints(_) | Semantic::Weights(_))));
    }
    Ok((source, mesh))
}

/// Removes what animated the shape of lit meshes.
fn end_shape_animations(root: &mut Root, is_lit: impl Fn(usize) -> bool) {
    for animation in &mut root.animations {
        animation.channels.retain(|channel| {
            channel.target.path != Valid(Property::MorphTargetWeights) || !is_lit(channel.target.node.value())
        });
    }
    root.animations.retain(|animation| !animation.channels.is_empty());
}
