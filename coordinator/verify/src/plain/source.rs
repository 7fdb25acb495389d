//! A document's primitives of triangles, in the order in which a walk of the scene's nodes meets them, and their vertex data.

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};
use gltf::accessor::{DataType, Dimensions, Iter};
use gltf::mesh::Mode;
use gltf::{Accessor, Document, Node, Primitive, Semantic};

use super::PlainError;
use document::accessors::{Context, is_within_bounds};
use document::nodes::is_hidden;
use document::placement::world_matrices;
use document::sky::{SkyImage, sky_of};
use document::{Folder, ImportError, ReadOptions, read_uri};

/// A document with its buffers.
pub(crate) struct PlainDocument {
    path: PathBuf,
    folder: Option<Folder>,
    pub(super) document: Document,
    buffers: Vec<Vec<u8>>,
    world: Vec<DMat4>,
    /// The sky of the scene, if it has one, and the factor of its radiance.
    pub(super) sky: Option<(SkyImage, f64)>,
    /// Warnings on what of it could not be read.
    pub(super) warnings: Vec<String>,
}

/// The geometry of one primitive at one node.
pub(crate) struct Geometry {
    /// World positions of its vertices.
    pub(crate) positions: Vec<DVec3>,
    /// Its triangles as existing vertices, counter-clockwise seen from the front.
    pub(crate) triangles: Vec<[usize; 3]>,
}

impl PlainDocument {
    /// Reads a .glb or .gltf file.
    pub(crate) fn open(path: &Path, options: &ReadOptions) -> Result<Self, PlainError> {
        let file = document::open(path, options)?;
        let mut warnings = vec![];
        let wrong = |problem| ImportError::new(&path.display().to_string(), problem);
        let sky = sky_of(&file, &mut warnings).map_err(wrong)?;
        let document::PlainDocument { document, buffers, folder, .. } = file;
        let world = world_matrices(&document);
        Ok(Self { path: path.to_owned(), folder, document, buffers, world, sky, warnings })
    }

    /// The file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The visible nodes of the default scene (the first, where none is), parents before children.
    pub(crate) fn nodes(&self) -> Vec<Node<'_>> {
        let mut found = Vec::new();
        let mut visited = vec![false; self.document.nodes().len()];
        let scene = self.document.default_scene().or_else(|| self.document.scenes().next());
        let mut stack: Vec<_> = scene.iter().flat_map(|scene| scene.nodes()).collect();
        stack.reverse();
        while let Some(node) = stack.pop() {
            if is_hidden(&node) || std::mem::replace(&mut visited[node.index()], true) {
                continue;
            }
            let children: Vec<_> = node.children().collect();
            stack.extend(children.into_iter().rev());
            found.push(node);
        }
        found
    }

    /// The primitives of triangles with their nodes: the order that references count in.
    pub(crate) fn primitives(&self) -> Vec<(Node<'_>, Primitive<'_>)> {
        let mut found = Vec::new();
        for node in self.nodes() {
            let primitives = node.mesh().into_iter().flat_map(|mesh| mesh.primitives());
            found.extend(primitives.filter(has_triangles).map(|primitive| (node.clone(), primitive)));
        }
        found
    }

    /// Where a node stands.
    pub(super) fn placement(&self, node: &Node) -> DMat4 {
        self.world[node.index()]
    }

    /// Positions and triangles of a primitive; a transform that mirrors has the winding turned round.
    pub(crate) fn geometry(&self, node: &Node, primitive: &Primitive<'_>) -> Result<Geometry, PlainError> {
        let world = self.world[node.index()];
        let positions: Vec<DVec3> = self
            .vectors(node, primitive.get(&Semantic::Positions), "POSITION")?
            .into_iter()
            .map(|position| world.transform_point3(position))
            .collect();
        if !positions.iter().all(|position| position.is_finite()) {
            let (path, place) = (self.path.clone(), label(node));
            return Err(PlainError::Factor { path, place, what: "POSITION", signed: true });
        }
        let mirrored = world.determinant() < 0.0;
        let mut triangles = triangles(primitive.mode(), &self.indices(node, primitive, positions.len())?);
        if mirrored {
            triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
        }
        Ok(Geometry { positions, triangles })
    }

    /// The rows of a float VEC3 accessor.
    pub(crate) fn vectors(
        &self,
        node: &Node,
        accessor: Option<Accessor<'_>>,
        what: &'static str,
    ) -> Result<Vec<DVec3>, PlainError> {
        let rows = accessor
            .filter(|accessor| {
                let typed =
                    accessor.data_type() == DataType::F32 && accessor.dimensions() == Dimensions::Vec3;
                typed && self.holds(accessor)
            })
            .and_then(|accessor| Iter::<[f32; 3]>::new(accessor, |buffer| self.bytes(&buffer)));
        let rows = rows.ok_or_else(|| self.unreadable(node, what))?;
        Ok(rows.map(|row| DVec3::from_array(row.map(f64::from))).collect())
    }

    /// The primitive's vertex indices, all of which exist.
    fn indices(
        &self,
        node: &Node,
        primitive: &Primitive<'_>,
        vertices: usize,
    ) -> Result<Vec<usize>, PlainError> {
        let Some(accessor) = primitive.indices() else { return Ok((0..vertices).collect()) };
        let typed = matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32)
            && accessor.dimensions() == Dimensions::Scalar;
        let reader = primitive.reader(|buffer| self.bytes(&buffer));
        (typed && self.holds(&accessor))
            .then(|| reader.read_indices())
            .flatten()
            .map(|indices| indices.into_u32().map(|index| index as usize).collect())
            .filter(|indices: &Vec<usize>| indices.iter().all(|&index| index < vertices))
            .ok_or_else(|| self.unreadable(node, "indices"))
    }

    /// Whether an accessor has elements, all of them inside its buffers: the glTF reader trusts counts and strides.
    fn holds(&self, accessor: &Accessor<'_>) -> bool {
        let context = Context { place: "", buffers: &self.buffers };
        accessor.count() > 0
            && accessor.sparse().is_none_or(|sparse| sparse.count() > 0)
            && is_within_bounds(accessor, &context)
    }

    /// Refuses an accessor of a vertex attribute that holds other than parts of 1 of these shapes, one for each vertex.
    pub(super) fn check(
        &self,
        node: &Node,
        accessor: &Accessor<'_>,
        vertices: usize,
        shapes: &[Dimensions],
        what: &'static str,
    ) -> Result<(), PlainError> {
        let numbers = matches!(accessor.data_type(), DataType::F32 | DataType::U8 | DataType::U16);
        let fits = numbers && shapes.contains(&accessor.dimensions()) && accessor.count() == vertices;
        if fits && self.holds(accessor) { Ok(()) } else { Err(self.unreadable(node, what)) }
    }

    /// The bytes of an image.
    pub(super) fn image_bytes(&self, image: &gltf::Image<'_>) -> Option<Vec<u8>> {
        match image.source() {
            gltf::image::Source::View { view, .. } => {
                let end = view.offset().checked_add(view.length())?;
                Some(self.bytes(&view.buffer())?.get(view.offset()..end)?.to_vec())
            }
            gltf::image::Source::Uri { uri, .. } => {
                let limit = ReadOptions::default().max_bytes;
                read_uri(uri, self.folder.as_ref(), limit).ok()
            }
        }
    }

    pub(super) fn bytes(&self, buffer: &gltf::Buffer<'_>) -> Option<&[u8]> {
        self.buffers.get(buffer.index()).map(Vec::as_slice)
    }

    fn unreadable(&self, node: &Node, what: &'static str) -> PlainError {
        PlainError::Data { path: self.path.clone(), node: label(node), what }
    }
}

/// The node's name, or its number where it has none.
pub(crate) fn label(node: &Node) -> String {
    node.name().map_or_else(|| format!("node {}", node.index()), |name| format!("node {name}"))
}

/// Whether a primitive has triangles, not points or lines.
pub(super) fn has_triangles(primitive: &Primitive<'_>) -> bool {
    matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)
}

/// Triangles of a list, strip or fan, wound as glTF 2.0 section 3.7.2.1 defines.
fn triangles(mode: Mode, indices: &[usize]) -> Vec<[usize; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let odd =
                |(i, c): (usize, &[usize])| if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] };
            indices.windows(3).enumerate().map(odd).collect()
        }
        Mode::TriangleFan => {
            let rim = indices.get(1..).unwrap_or_default();
            rim.windows(2).map(|pair| [pair[0], pair[1], indices[0]]).collect()
        }
        _ => indices.as_chunks::<3>().0.to_vec(),
    }
}
