//! Import errors. Each message names the place in the file and the cure.

use std::io;

/// Why a glTF could not be imported.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {problem}")]
pub struct ImportError {
    /// The file, or a name for bytes that did not come from one.
    pub file: String,
    /// The fault.
    pub problem: Box<ImportProblem>,
}

impl ImportError {
    /// An error of this file.
    #[must_use]
    pub fn new(file: &str, problem: ImportProblem) -> Self {
        Self { file: file.to_owned(), problem: Box::new(problem) }
    }
}

/// A fault of a glTF file. Places are given as `node "name"` or, without a name, `node 3`.
#[derive(Debug, thiserror::Error)]
pub enum ImportProblem {
    /// The file cannot be opened or read.
    #[error("cannot be read: {0}; check the path and the permissions")]
    Unreadable(io::Error),
    /// File and external buffers together exceed [`super::ReadOptions::max_bytes`].
    #[error(
        "is larger than the limit of {limit} bytes, external buffers included; raise the limit or split the scene"
    )]
    TooLarge {
        /// The limit.
        limit: u64,
    },
    /// Neither GLB nor JSON.
    #[error("is not a glTF: it starts neither like a GLB nor like JSON; export the scene as .glb or .gltf")]
    NotGltf,
    /// glTF 1.0, or a version from the future.
    #[error("is glTF {version}, but only glTF 2 is read; export it as glTF 2.0")]
    Version {
        /// The version found.
        version: String,
    },
    /// The file ends too early.
    #[error("is truncated: {detail}; copy or export it again")]
    Truncated {
        /// The missing part.
        detail: String,
    },
    /// The container or the JSON is malformed.
    #[error("is not valid glTF: {detail}; check it with gltf-validator and export it again")]
    Malformed {
        /// The parser's message.
        detail: String,
    },
    /// An index in the JSON refers to nothing.
    #[error(
        "{path} refers to something that is not in the file; check it with gltf-validator and export it again"
    )]
    DanglingIndex {
        /// Path in the JSON.
        path: String,
    },
    /// Any other required extension.
    #[error("requires {extension}, which is not supported; export it without that extension")]
    ExtensionRequired {
        /// Name of the extension.
        extension: String,
    },
    /// Compressed, quantized, instanced or posed geometry that does not hold what it should.
    #[error("{place}: cannot be decoded: {detail}; the file is damaged, export it again")]
    Undecodable {
        /// The extension or attribute, and the node or buffer view.
        place: String,
        /// The fault.
        detail: String,
    },
    /// A buffer in a file of its own cannot be read.
    #[error(
        "buffer {buffer}: external file `{uri}` cannot be read: {error}; put it next to the glTF or export as .glb"
    )]
    ExternalFile {
        /// Index of the buffer.
        buffer: usize,
        /// The reference in the file.
        uri: String,
        /// The operating system's error.
        error: io::Error,
    },
    /// A reference that is refused for safety.
    #[error("buffer {buffer}: `{uri}` is not read: {why}; export as .glb, which holds its buffers itself")]
    RefusedUri {
        /// Index of the buffer.
        buffer: usize,
        /// The reference in the file, shortened.
        uri: String,
        /// Why it is not followed.
        why: &'static str,
    },
    /// A buffer without data.
    #[error(
        "buffer {buffer} has no data: no uri, and no binary chunk in the file; export the scene again as .glb"
    )]
    BufferMissing {
        /// Index of the buffer.
        buffer: usize,
    },
    /// Fewer bytes than declared.
    #[error("buffer {buffer} has {actual} of its {declared} bytes; copy or export it again")]
    BufferTooShort {
        /// Index of the buffer.
        buffer: usize,
        /// Length that the JSON states.
        declared: u64,
        /// Length found.
        actual: u64,
    },
    /// No scene of the requested name or index.
    #[error("has no scene `{wanted}`, but {scenes}; choose one of these with --scene")]
    NoSuchScene {
        /// Requested name or index.
        wanted: String,
        /// The scenes of the file.
        scenes: String,
    },
    /// Several scenes of the requested name.
    #[error("has several scenes `{wanted}` among {scenes}; choose one by its index with --scene")]
    AmbiguousScene {
        /// Requested name or index.
        wanted: String,
        /// The scenes of the file.
        scenes: String,
    },
    /// A node that is its own ancestor, or has two parents.
    #[error(
        "{node} is reached twice: the nodes form a cycle or share a child, but must form a tree; repair the hierarchy and export again"
    )]
    CyclicNodes {
        /// The node.
        node: String,
    },
    /// NaN, infinity or a zero quaternion in a transform.
    #[error("{node}: its transform is not finite; reset or apply the transform and export again")]
    NodeTransform {
        /// The node.
        node: String,
    },
    /// An accessor that reaches past its buffer, or has none and claims more than any file of this length needs.
    #[error(
        "{place}: accessor {accessor} ({attribute}) reaches outside its buffer, or has none and more elements than the file has \
         bytes; the file is damaged, export it again"
    )]
    AccessorOutOfBounds {
        /// Node and primitive.
        place: String,
        /// Index of the accessor.
        accessor: usize,
        /// Attribute in it.
        attribute: String,
    },
    /// An accessor of a component type or shape that the attribute may not have.
    #[error(
        "{place}: accessor {accessor} ({attribute}) is {found}, not {expected}; if the file is quantized, it must say so in extensionsRequired"
    )]
    AccessorFormat {
        /// Node and primitive.
        place: String,
        /// Index of the accessor.
        accessor: usize,
        /// Attribute in it.
        attribute: String,
        /// Format found.
        found: String,
        /// Formats allowed.
        expected: &'static str,
    },
    /// An accessor without elements.
    #[error(
        "{place}: accessor {accessor} ({attribute}) has no elements; remove the empty primitive and export again"
    )]
    AccessorEmpty {
        /// Node and primitive.
        place: String,
        /// Index of the accessor.
        accessor: usize,
        /// Attribute in it.
        attribute: String,
    },
    /// Attributes of one primitive that differ in length.
    #[error(
        "{place}: {attribute} has {found} elements for {expected} positions; the file is damaged, export it again"
    )]
    AttributeCount {
        /// Node and primitive.
        place: String,
        /// Attribute.
        attribute: String,
        /// Its number of elements.
        found: usize,
        /// Number of positions.
        expected: usize,
    },
    /// A vertex index beyond the primitive's vertices.
    #[error(
        "{place}: vertex index {index} is out of range, there are {count} vertices; the file is damaged, export it again"
    )]
    IndexOutOfRange {
        /// Node and primitive.
        place: String,
        /// The index.
        index: u32,
        /// Number of vertices.
        count: usize,
    },
    /// NaN or infinity among the positions.
    #[error("{place}: vertex {vertex} has a position that is not finite; repair the mesh and export again")]
    NonFinitePosition {
        /// Node and primitive.
        place: String,
        /// Index of the vertex.
        vertex: usize,
    },
    /// NaN or infinity in an attribute that the output takes over.
    #[error(
        "{place}: vertex {vertex} has a {attribute} that is not finite; repair or remove the attribute and export again"
    )]
    NonFiniteAttribute {
        /// Node and primitive.
        place: String,
        /// The attribute.
        attribute: String,
        /// Index of the vertex.
        vertex: usize,
    },
    /// NaN or infinity in an animation, which the output takes over.
    #[error("{place}: {value} is among them; repair or remove the animation and export again")]
    NonFiniteAnimation {
        /// The animation, its sampler, and which of its numbers.
        place: String,
        /// The value.
        value: f32,
    },
    /// Places of a sparse accessor that are out of range or out of order.
    #[error(
        "{place}: accessor {accessor} ({attribute}) is sparse and replaces element {index} of {count}: its indices must be in range \
         and in order; the file is damaged, export it again"
    )]
    SparseIndex {
        /// Node and primitive.
        place: String,
        /// Index of the accessor.
        accessor: usize,
        /// Attribute in it.
        attribute: String,
        /// The index.
        index: u64,
        /// Number of elements.
        count: u64,
    },
    /// JSON that is nested too deep.
    #[error(
        "{place}: objects and lists are nested more than {limit} deep; remove these extras or extensions and export again"
    )]
    NestedTooDeep {
        /// Member of the document and its index.
        place: String,
        /// The limit.
        limit: usize,
    },
    /// A surface that emits light and is next to nothing in its scene.
    #[error(
        "{place}: emits light and is {extent:.1e} across in a scene of {whole:.1e}, so all of its light would be lost; check the \
         scales and places of its node and of {far}"
    )]
    TooSmall {
        /// Node and primitive.
        place: String,
        /// Largest side of its bounding box, file units.
        extent: f64,
        /// That of the scene.
        whole: f64,
        /// Node and primitive that reach farthest from it.
        far: String,
    },
    /// A light whose irradiance is out of the range of numbers.
    #[error(
        "{place}: gives an irradiance of about {value:.1e}, more than can be computed with; lower its intensity, or check the scales \
         of the nodes"
    )]
    TooBright {
        /// The light's node, or the material.
        place: String,
        /// The irradiance.
        value: f64,
    },
    /// More triangles than [`super::ReadOptions::max_triangles`].
    #[error(
        "{place}: the scene has more than {limit} triangles up to here, or three times as many vertices; raise the limit or simplify the scene"
    )]
    TooManyTriangles {
        /// Node and primitive.
        place: String,
        /// The limit.
        limit: usize,
    },
    /// A material or light factor out of range.
    #[error("{place}: {factor} is {value}; it must be {expected}")]
    Factor {
        /// Material or light.
        place: String,
        /// Which factor.
        factor: &'static str,
        /// Its value.
        value: f32,
        /// The allowed range.
        expected: &'static str,
    },
    /// A light that breaks the rules of its extension.
    #[error("{place}: {detail}; correct its {extension} light and export again")]
    Light {
        /// The light's node.
        place: String,
        /// The extension.
        extension: &'static str,
        /// The fault.
        detail: String,
    },
    /// A node that scales its mesh to zero: its coordinates cannot hold refined positions.
    #[error("has {primitive} under a node with a scale of zero; give it a small scale in place of zero")]
    FlatNode {
        /// Node and primitive.
        primitive: String,
    },
    /// No triangle has an area.
    #[error(
        "has no triangles with an area in its scene; add a mesh, and check that its nodes are in the default scene and are not scaled to zero"
    )]
    NoTriangles,
    /// No light source.
    #[error(
        "has no light; give a material an emissiveFactor, add a light (KHR_lights_punctual, EXT_lights_area, EXT_lights_image_based), or give --sky"
    )]
    NoLight,
    /// The scene cannot be scaled to a working size.
    #[error(
        "has a largest extent of {extent}, which cannot be scaled to a working size; check the scales of the nodes"
    )]
    Extent {
        /// Largest side of the bounding box, file units.
        extent: f64,
    },
}
