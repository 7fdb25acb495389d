//! Primitives as triangle lists, with the vertex attributes that matter to facets.

use gltf::accessor::{DataType, Dimensions, Iter};
use gltf::mesh::Mode;
use gltf::{Accessor, Primitive, Semantic};

use document::ImportProblem;
use document::accessors::{COLOUR, Context, INDICES, TEXTURE_COORDINATES, VECTOR, check, check_bytes};

/// A primitive's geometry, in the node's coordinates.
pub(super) struct Geometry {
    /// POSITION.
    pub(super) positions: Vec<[f32; 3]>,
    /// NORMAL, as long as the positions.
    pub(super) normals: Option<Vec<[f32; 3]>>,
    /// TEXCOORD_n and COLOR_n.
    pub(super) attributes: VertexAttributes,
    /// Indices into the above.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Whether COLOR_0 is light of an earlier bake rather than a colour: there is _IRRADIANCE beside it.
    pub(super) is_lit: bool,
}

impl Geometry {
    /// Whether there is COLOR_0.
    pub(super) fn has_colours(&self) -> bool {
        self.attributes.sets.iter().any(|(own, _)| *own == Semantic::Colors(0))
    }

    /// COLOR_0 as a colour of the surface: linear, not negative.
    pub(super) fn albedo(&self) -> Option<Vec<[f32; 4]>> {
        let colours = self.attributes.set(Semantic::Colors(0)).filter(|_| !self.is_lit)?;
        Some(colours.map(|colour| std::array::from_fn(|i| colour[i].max(0.0))).collect())
    }
}

/// The values that are interpolated over triangles, all sets of a vertex side by side.
#[derive(Default)]
pub(super) struct VertexAttributes {
    /// Values per vertex.
    width: usize,
    values: Vec<f32>,
    /// Which sets there are, and where the values of each begin.
    sets: Vec<(Semantic, usize)>,
}

impl VertexAttributes {
    /// The values of a vertex; empty where the primitive has none.
    pub(super) fn of(&self, vertex: u32) -> &[f32] {
        &self.values[vertex as usize * self.width..][..self.width]
    }

    /// Puts the sets side by side; all are as long as there are vertices.
    fn interleave(sets: Vec<(Semantic, Vec<f32>)>, vertices: usize) -> Self {
        let widths: Vec<usize> = sets.iter().map(|(_, set)| set.len() / vertices.max(1)).collect();
        let mut values = Vec::with_capacity(sets.iter().map(|(_, set)| set.len()).sum());
        for vertex in 0..vertices {
            for ((_, set), &width) in sets.iter().zip(&widths) {
                values.extend_from_slice(&set[vertex * width..][..width]);
            }
        }
        let starts = widths.iter().scan(0, |next, width| Some(std::mem::replace(next, *next + width)));
        let known = sets.into_iter().zip(starts).map(|((semantic, _), start)| (semantic, start));
        Self { width: widths.iter().sum(), values, sets: known.collect() }
    }

    /// The values of a set from its first on, vertex by vertex; none where the primitive does not have it.
    fn set(&self, semantic: Semantic) -> Option<impl Iterator<Item = &[f32]>> {
        let (_, start) = self.sets.iter().find(|(own, _)| *own == semantic)?;
        Some(self.values.chunks_exact(self.width).map(|values| &values[*start..]))
    }

    /// TEXCOORD_n.
    pub(super) fn coordinates(&self, set: u32) -> Option<Vec<[f32; 2]>> {
        let values = self.set(Semantic::TexCoords(set))?;
        Some(values.map(|pair| [pair[0], pair[1]]).collect())
    }

    /// Whether there is TEXCOORD_n.
    pub(super) fn has_coordinates(&self, set: u32) -> bool {
        self.sets.iter().any(|(own, _)| *own == Semantic::TexCoords(set))
    }
}

/// Whether the primitive has triangles, not points or lines.
pub(super) fn has_triangles(primitive: &Primitive) -> bool {
    matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)
}

/// Number of triangles, without reading them.
pub(super) fn triangle_count(primitive: &Primitive) -> usize {
    let vertices = match (primitive.indices(), primitive.get(&Semantic::Positions)) {
        (Some(indices), _) => indices.count(),
        (None, Some(positions)) => positions.count(),
        (None, None) => 0,
    };
    match primitive.mode() {
        Mode::Triangles => vertices / 3,
        Mode::TriangleStrip | Mode::TriangleFan => vertices.saturating_sub(2),
        _ => 0,
    }
}

/// Number of vertices, without reading them.
pub(super) fn vertex_count(primitive: &Primitive) -> usize {
    primitive.get(&Semantic::Positions).map_or(0, |positions| positions.count())
}

/// Reads a primitive of triangles, checking every accessor first.
pub(super) fn read(primitive: &Primitive, context: &Context) -> Result<Geometry, ImportProblem> {
    let reader = primitive.reader(|buffer| context.buffers.get(buffer.index()).map(Vec::as_slice));
    let missing = |attribute: &str| ImportProblem::AttributeCount {
        place: context.place.to_owned(),
        attribute: attribute.to_owned(),
        found: 0,
        expected: 1,
    };

    let accessor = primitive.get(&Semantic::Positions).ok_or_else(|| missing("POSITION"))?;
    check(&accessor, "POSITION", &VECTOR, context)?;
    let positions: Vec<[f32; 3]> = reader.read_positions().ok_or_else(|| missing("POSITION"))?.collect();
    check_count("POSITION", positions.len(), accessor.count(), context)?;

    let normals = match primitive.get(&Semantic::Normals) {
        Some(accessor) => {
            check(&accessor, "NORMAL", &VECTOR, context)?;
            check_count("NORMAL", accessor.count(), positions.len(), context)?;
            Some(reader.read_normals().ok_or_else(|| missing("NORMAL"))?.collect())
        }
        None => None,
    };

    let mut sets: Vec<(Semantic, Vec<f32>)> = Vec::new();
    let mut is_lit = false;
    for (semantic, accessor) in primitive.attributes() {
        let name = semantic.to_string();
        match semantic {
            Semantic::TexCoords(set) => {
                check(&accessor, &name, &TEXTURE_COORDINATES, context)?;
                check_count(&name, accessor.count(), positions.len(), context)?;
                let values = reader.read_tex_coords(set).ok_or_else(|| missing(&name))?;
                let values: Vec<f32> = values.into_f32().flatten().collect();
                check_finite(&values, 2, &name, context)?;
                sets.push((semantic, values));
            }
            Semantic::Colors(set) => {
                check(&accessor, &name, &COLOUR, context)?;
                check_count(&name, accessor.count(), positions.len(), context)?;
                let values = reader.read_colors(set).ok_or_else(|| missing(&name))?;
                let values: Vec<f32> = values.into_rgba_f32().flatten().collect();
                check_finite(&values, 4, &name, context)?;
                sets.push((semantic, values));
            }
            Semantic::Tangents | Semantic::Extras(_) => {
                is_lit |= name == "_IRRADIANCE";
                check_kept(&accessor, &name, positions.len(), context)?;
            }
            _ => {}
        }
    }

    let indices: Vec<u32> = match primitive.indices() {
        Some(accessor) => {
            check(&accessor, "indices", &INDICES, context)?;
            reader.read_indices().ok_or_else(|| missing("indices"))?.into_u32().collect()
        }
        None => (0..positions.len() as u32).collect(),
    };
    if let Some(&index) = indices.iter().find(|&&index| index as usize >= positions.len()) {
        let (place, count) = (context.place.to_owned(), positions.len());
        return Err(ImportProblem::IndexOutOfRange { place, index, count });
    }

    let attributes = VertexAttributes::interleave(sets, positions.len());
    Ok(Geometry { triangles: triangles(primitive.mode(), &indices), positions, normals, attributes, is_lit })
}

/// Checks an attribute that the output takes over as it is. Light of an earlier bake is not, nor are matrices.
fn check_kept(
    accessor: &Accessor,
    name: &str,
    vertices: usize,
    context: &Context,
) -> Result<(), ImportProblem> {
    let width = accessor.dimensions().multiplicity();
    let is_made_anew = ["_IRRADIANCE", "_COLOR_0", "_UNSHOT"].iter().any(|own| name.starts_with(own));
    if is_made_anew || width > 4 || accessor.dimensions() == Dimensions::Mat2 {
        return Ok(());
    }
    if accessor.count() < vertices.max(1) {
        return check_count(name, accessor.count(), vertices, context);
    }
    check_bytes(accessor, name, context)?;
    if accessor.data_type() != DataType::F32 {
        return Ok(());
    }
    let data = |buffer: gltf::Buffer<'_>| context.buffers.get(buffer.index()).map(Vec::as_slice);
    let values: Option<Vec<f32>> = match width {
        1 => Iter::<f32>::new(accessor.clone(), data).map(Iterator::collect),
        2 => Iter::<[f32; 2]>::new(accessor.clone(), data).map(|rows| rows.flatten().collect()),
        3 => Iter::<[f32; 3]>::new(accessor.clone(), data).map(|rows| rows.flatten().collect()),
        _ => Iter::<[f32; 4]>::new(accessor.clone(), data).map(|rows| rows.flatten().collect()),
    };
    check_finite(&values.unwrap_or_default(), width, name, context)
}

/// Checks an attribute of `width` numbers per vertex.
fn check_finite(values: &[f32], width: usize, name: &str, context: &Context) -> Result<(), ImportProblem> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(ImportProblem::NonFiniteAttribute {
            place: context.place.to_owned(),
            attribute: name.to_owned(),
            vertex: index / width,
        }),
        None => Ok(()),
    }
}

pub(super) fn check_count(
    attribute: &str,
    found: usize,
    expected: usize,
    context: &Context,
) -> Result<(), ImportProblem> {
    if found == expected {
        return Ok(());
    }
    let (place, attribute) = (context.place.to_owned(), attribute.to_owned());
    Err(ImportProblem::AttributeCount { place, attribute, found, expected })
}

/// Triangles of a list, strip or fan of vertices, wound as glTF 2.0 section 3.7.2.1 defines. An incomplete last triangle is left out;
/// points and lines have none.
#[must_use]
pub fn triangles(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::Triangles => indices.chunks_exact(3).map(|corner| [corner[0], corner[1], corner[2]]).collect(),
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, corner)| match i % 2 {
                0 => [corner[0], corner[1], corner[2]],
                _ => [corner[0], corner[2], corner[1]],
            })
            .collect(),
        Mode::TriangleFan => match indices.split_first() {
            Some((&hub, rim)) => rim.windows(2).map(|pair| [pair[0], pair[1], hub]).collect(),
            None => Vec::new(),
        },
        _ => Vec::new(),
    }
}
