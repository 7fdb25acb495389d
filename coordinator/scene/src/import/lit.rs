//! Files that are lit already: what pictures need of them, nothing welded and nothing joined.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::{DAffine3, DVec3};
use gltf::accessor::{Dimensions, Iter};
use gltf::{Document, Primitive, Semantic};
use kernel::geometry::Bounds;
use rayon::prelude::*;

use super::primitives::check_count;
use super::{frame, primitives, triangles};
use crate::frame::Frame;
use document::LightmapLink;
use document::accessors::{COLOUR, Context, TEXTURE_COORDINATES, TINT, VECTOR, check};
use document::images::{self, Images};
use document::labels::node_label;
use document::{ImportError, ImportProblem};
use document::{PlainDocument, ReadOptions, nodes};

/// The attribute that holds light, without its underscore.
const IRRADIANCE: &str = "IRRADIANCE";

/// A file with its triangles where they stand.
pub struct LitDocument {
    /// The document: materials, cameras, textures.
    pub document: Document,
    /// Decoded images of its materials, by index; those that cannot be read are missing.
    pub images: Images,
    /// All triangles of the scene.
    pub primitives: Vec<LitPrimitive>,
    /// Nodes of the scene with a camera: their index, and their transform to the world.
    pub cameras: Vec<(usize, DAffine3)>,
    /// How frame coordinates relate to the file's.
    pub frame: Frame,
    /// Warnings on what was left out.
    pub warnings: Vec<String>,
}

/// A primitive of a node.
pub struct LitPrimitive {
    /// Index of its material; `None` for the default one.
    pub material: Option<usize>,
    /// Positions of its vertices in the frame.
    pub positions: Vec<DVec3>,
    /// How far a position may be off because its coordinates were rounded to f32, in the frame.
    pub rounding: f64,
    /// Its triangles, counter-clockwise seen from their fronts.
    pub triangles: Vec<[u32; 3]>,
    /// `_IRRADIANCE`.
    pub irradiance: Option<Vec<[f32; 3]>>,
    /// `COLOR_0`, linear: in a lit file light, exposed and clamped; with a lightmap what multiplies base colour.
    pub colours: Option<Vec<[f32; 4]>>,
    /// `_COLOR_0`: what was `COLOR_0` before the file was lit, and multiplies base colour.
    pub tint: Option<Vec<[f32; 4]>>,
    /// `TEXCOORD_n`, by n.
    pub coordinates: BTreeMap<u32, Vec<[f32; 2]>>,
}

/// Reads a .glb or .gltf file, lit or not.
///
/// # Errors
/// As [`super::import`], except for what only a bake needs.
pub fn import_lit(path: &Path, options: &ReadOptions) -> Result<LitDocument, ImportError> {
    let file = document::open(path, options)?;
    lit_document(file, options).map_err(|problem| ImportError::new(&path.display().to_string(), problem))
}

fn lit_document(mut file: PlainDocument, options: &ReadOptions) -> Result<LitDocument, ImportProblem> {
    let mut warnings = std::mem::take(&mut file.warnings);
    let images = images::decode(&file, &shown_images(&file.document), &mut warnings);
    let PlainDocument { document, buffers, .. } = file;
    let mut triangles_left = options.max_triangles;
    let mut placed_primitives = Vec::new();
    let mut cameras = Vec::new();
    for placed in nodes::walk(&document)? {
        if placed.node.camera().is_some() {
            cameras.push((placed.node.index(), placed.world));
        }
        let mesh = placed.node.mesh().filter(|_| placed.is_visible);
        for primitive in mesh.iter().flat_map(|mesh| mesh.primitives()) {
            let place = format!("{}, primitive {}", node_label(&placed.node), primitive.index());
            if !primitives::has_triangles(&primitive) {
                continue;
            }
            let (limit, count) = (options.max_triangles, primitives::triangle_count(&primitive));
            triangles_left = triangles_left
                .checked_sub(count)
                .ok_or_else(|| ImportProblem::TooManyTriangles { place: place.clone(), limit })?;
            let context = Context { place: &place, buffers: &buffers };
            placed_primitives.push(read_primitive(&primitive, &placed.world, &context)?);
        }
    }
    if placed_primitives.iter().all(|primitive| primitive.triangles.is_empty()) {
        return Err(ImportProblem::NoTriangles);
    }
    let frame = frame::fit(
        placed_primitives.par_iter().map(|primitive: &LitPrimitive| Bounds::around(&primitive.positions)),
    )?;
    for primitive in &mut placed_primitives {
        primitive.positions.iter_mut().for_each(|position| *position = frame.to_frame(*position));
        primitive.rounding /= frame.scale;
    }
    Ok(LitDocument { document, images, primitives: placed_primitives, cameras, frame, warnings })
}

/// A primitive with its positions in the world.
fn read_primitive(
    primitive: &Primitive,
    world: &DAffine3,
    context: &Context,
) -> Result<LitPrimitive, ImportProblem> {
    let geometry = primitives::read(primitive, context)?;
    let count = geometry.positions.len();
    let positions: Vec<DVec3> =
        geometry.positions.iter().map(|&position| triangles::to_world(world, position)).collect();
    if let Some(vertex) = positions.iter().position(|position| !position.is_finite()) {
        return Err(ImportProblem::NonFinitePosition { place: context.place.to_owned(), vertex });
    }
    let largest = positions.iter().map(|position| position.abs().max_element()).fold(0.0, f64::max);
    let data = |buffer: gltf::Buffer| context.buffers.get(buffer.index()).map(Vec::as_slice);
    let reader = primitive.reader(|buffer| context.buffers.get(buffer.index()).map(Vec::as_slice));
    let (mut irradiance, mut colours, mut tint, mut coordinates) = (None, None, None, BTreeMap::new());
    for (semantic, accessor) in primitive.attributes() {
        let name = semantic.to_string();
        let checked = |format| {
            check(&accessor, &name, format, context)?;
            check_count(&name, accessor.count(), count, context)
        };
        match &semantic {
            Semantic::Extras(extra) if extra == IRRADIANCE => {
                checked(&VECTOR)?;
                irradiance = Iter::new(accessor.clone(), data).map(Iterator::collect);
            }
            // The exporter writes it as floats, as many as there were.
            Semantic::Extras(extra) if extra == "COLOR_0" => {
                checked(&TINT)?;
                tint = match accessor.dimensions() {
                    Dimensions::Vec4 => Iter::<[f32; 4]>::new(accessor.clone(), data).map(Iterator::collect),
                    _ => Iter::<[f32; 3]>::new(accessor.clone(), data)
                        .map(|values| values.map(|[red, green, blue]| [red, green, blue, 1.0]).collect()),
                };
            }
            Semantic::Colors(0) => {
                checked(&COLOUR)?;
                colours = reader.read_colors(0).map(|values| values.into_rgba_f32().collect());
            }
            Semantic::TexCoords(set) => {
                checked(&TEXTURE_COORDINATES)?;
                if let Some(values) = reader.read_tex_coords(*set) {
                    coordinates.insert(*set, values.into_f32().collect());
                }
            }
            _ => {}
        }
    }
    let is_mirrored = world.matrix3.determinant() < 0.0;
    let turned = |&[a, b, c]: &[u32; 3]| if is_mirrored { [a, c, b] } else { [a, b, c] };
    Ok(LitPrimitive {
        material: primitive.material().index(),
        rounding: triangles::rounding_of(largest),
        triangles: geometry.triangles.iter().map(turned).collect(),
        positions,
        irradiance,
        colours,
        tint,
        coordinates,
    })
}

/// The images that pictures show: of base colours, emissions, and lightmaps of what has no other light.
fn shown_images(document: &Document) -> BTreeSet<usize> {
    let has_light = |primitive: &Primitive| primitive.get(&Semantic::Extras(IRRADIANCE.to_owned())).is_some();
    let primitives = document.meshes().flat_map(|mesh| mesh.primitives());
    let dark: BTreeSet<Option<usize>> =
        primitives.filter(|primitive| !has_light(primitive)).map(|own| own.material().index()).collect();
    let of = |material: gltf::Material| {
        let base = material.pbr_metallic_roughness().base_color_texture();
        let diffuse = material.pbr_specular_glossiness().and_then(|glossy| glossy.diffuse_texture());
        let infos = [base, diffuse, material.emissive_texture()].into_iter().flatten();
        let textures = infos.map(|info| info.texture());
        let lightmap = LightmapLink::of(document, &material).filter(|_| dark.contains(&material.index()));
        let textures = textures.chain(lightmap.map(|lightmap| lightmap.texture));
        textures.filter_map(|texture| images::image_of(&texture)).collect::<Vec<_>>()
    };
    document.materials().flat_map(of).collect()
}
