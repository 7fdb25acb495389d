//! glTF in, scene out.
//!
//! | module | step |
//! |---|---|
//! | `document` | bytes to a validated document |
//! | `scene_choice` | which of its scenes is baked |
//! | `buffers` | its buffers, from the file or next to it |
//! | `prepare` | what is compressed, quantized, instanced or posed made plain |
//! | `nodes` | the nodes of the scene and their world matrices |
//! | `accessors`, `primitives` | vertex data and triangles of each primitive |
//! | `images`, `materials`, `lights` | reflectance, exitance, intensity |
//! | `lit` | files that are lit already, for pictures |
//! | `weld` | vertices that are nearly one made one, if asked for |
//! | `frame`, `triangles` | triangles in the frame, welded |
//! | `facets` | flat convex pieces |
//! | `appearances` | what textures and vertex colours make of them |
//! | `planes` | which of them are coplanar |
//! | `account` | what counts, and what is passed over |
//!
//! Files are not trusted: whatever the bytes, the answer is a scene or an [`ImportError`].

mod appearances;
mod facets;
mod frame;
mod lights;
mod lit;
mod materials;
mod planes;
mod primitives;
mod tally;
mod triangles;
mod weld;

#[cfg(test)]
mod test_document;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use document::{ImportError, ImportProblem, LightUnit, PlainDocument, ReadOptions, buffers};
use glam::{DAffine3, DVec3};
use gltf::Document;
use rayon::prelude::*;

pub use self::lit::{LitDocument, LitPrimitive, import_lit};

use self::lights::WorldLight;
use self::materials::Materials;
use self::primitives::Geometry;
use self::tally::Tally;
use self::triangles::TriangleMesh;
use crate::account::Account;
use crate::appearance::Pattern;
use crate::facet::Facet;
use crate::light::Light;
use crate::model::{Frame, Scene, Side, SourceDocument, Surface};
use document::accessors::Context;
use document::images::{self, Sources};
use document::nodes::{self, PlacedNode, node_label};

/// Name of a scene in messages that did not come from a file.
const UNNAMED: &str = "the glTF";

/// How a file is read: what of it is meant, and limits for files that are not trusted or just too large for the machine.
#[derive(Debug, Clone)]
pub struct ImportOptions {
    /// Which scene of the file is meant, and how large it may be.
    pub read: ReadOptions,
    /// Vertices closer than this, in the file's units, become one before anything else. None do unless told otherwise, but
    /// those that are equal.
    pub weld: Option<f64>,
    /// Whether a scene without any light is an error. It is unless told otherwise: a bake of it would be black.
    pub needs_light: bool,
    /// How the numbers of the file's lights are meant.
    pub light_unit: LightUnit,
    /// Radiance of a uniform sky around the scene, in the unit of the scene's light: W/(m^2 sr), or cd/m^2. None unless told
    /// otherwise; finite, not negative.
    pub sky: DVec3,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self {
            read: ReadOptions::default(),
            weld: None,
            needs_light: true,
            light_unit: LightUnit::Candela,
            sky: DVec3::ZERO,
        }
    }
}

/// Imports a .glb or .gltf file. External buffers are read from the file's folder or below, never from elsewhere.
pub fn import(path: &Path, options: &ImportOptions) -> Result<Scene, ImportError> {
    let file = path.display().to_string();
    let fail = |problem| ImportError::new(&file, problem);
    let bytes = buffers::read_file(path, options.read.max_bytes)
        .map_err(|error| fail(ImportProblem::Unreadable(error)))?
        .ok_or_else(|| fail(ImportProblem::TooLarge { limit: options.read.max_bytes }))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    read_scene(&bytes, Some(folder), options).map_err(fail)
}

/// Imports a glTF from memory. Data URIs are read, references to files refused.
pub fn import_slice(bytes: &[u8], options: &ImportOptions) -> Result<Scene, ImportError> {
    let fail = |problem| ImportError::new(UNNAMED, problem);
    if bytes.len() as u64 > options.read.max_bytes {
        return Err(fail(ImportProblem::TooLarge { limit: options.read.max_bytes }));
    }
    read_scene(bytes, None, options).map_err(fail)
}

fn read_scene(bytes: &[u8], folder: Option<&Path>, options: &ImportOptions) -> Result<Scene, ImportProblem> {
    let PlainDocument { document, buffers, required, warnings } =
        document::read(bytes, folder, &options.read)?;
    let mut content = Content { warnings, ..Content::default() };
    document::parse::warn_ignored_extensions(document.as_json(), &mut content.warnings);
    let read = bytes.len() as u64 + buffers::bytes_beside(document.as_json(), &buffers);
    let sources = Sources {
        buffers: &buffers,
        folder,
        budget: options.read.max_bytes.saturating_sub(read),
        max_bytes: options.read.max_bytes,
    };
    content.collect(&document, &sources, options)?;
    let mut root = document.into_json();
    document::parse::require_again(&mut root, required);
    let source = SourceDocument { root, buffers, folder: folder.map(Path::to_owned) };
    content.into_scene(source, options)
}

/// A primitive of a node, before the frame is known.
struct PlacedPrimitive {
    node: usize,
    primitive: usize,
    name: String,
    world: DAffine3,
    geometry: Geometry,
    /// World positions of the vertices, where they were welded.
    welded: Option<Vec<DVec3>>,
    pattern: Arc<Pattern>,
    double_sided: bool,
}

/// What the nodes of the scene hold.
#[derive(Default)]
struct Content {
    primitives: Vec<PlacedPrimitive>,
    lights: Vec<WorldLight>,
    warnings: Vec<String>,
    tally: Tally,
}

impl Content {
    fn collect(
        &mut self,
        document: &Document,
        sources: &Sources,
        options: &ImportOptions,
    ) -> Result<(), ImportProblem> {
        let all_placed = nodes::walk(document)?;
        let mut materials = self.materials(document, &all_placed, sources);
        let mut geometries = read_geometries(&all_placed, sources, options).into_iter();
        for placed in all_placed {
            self.lights.extend(lights::read(document, &placed, options.light_unit, &mut self.warnings)?);
            let Some(mesh) = placed.node.mesh() else { continue };
            for primitive in mesh.primitives() {
                let place = place_of(&placed, &primitive);
                if !primitives::has_triangles(&primitive) {
                    self.warnings.push(format!("{place}: points and lines left out, only triangles are lit"));
                    continue;
                }
                let too_many = || ImportProblem::TooManyTriangles {
                    place: place.clone(),
                    limit: options.read.max_triangles,
                };
                let geometry = geometries.next().ok_or_else(too_many)??;
                let material = primitive.material();
                let pattern = materials.pattern(&material, &mut self.tally, &mut self.warnings)?;
                self.look_at_vertices(&place, &pattern, &geometry);
                self.primitives.push(PlacedPrimitive {
                    node: placed.node.index(),
                    primitive: primitive.index(),
                    name: place,
                    world: placed.world,
                    geometry,
                    welded: None,
                    pattern,
                    double_sided: material.double_sided(),
                });
            }
        }
        Ok(())
    }

    /// The materials, with the images decoded that they will need.
    fn materials(&mut self, document: &Document, placed: &[PlacedNode], sources: &Sources) -> Materials {
        let meshes = placed.iter().filter_map(|placed| placed.node.mesh());
        let primitives = meshes.flat_map(|mesh| mesh.primitives()).filter(primitives::has_triangles);
        let mut in_use: Vec<gltf::Material> = primitives.map(|primitive| primitive.material()).collect();
        in_use.sort_by_key(gltf::Material::index);
        in_use.dedup_by_key(|material| material.index());
        let needed: BTreeSet<usize> = in_use.iter().flat_map(materials::needed_images).collect();
        Materials::new(images::decode(document, &needed, sources, &mut self.warnings))
    }

    /// What is to be said about a primitive's colours and texture coordinates.
    fn look_at_vertices(&mut self, place: &str, pattern: &Pattern, geometry: &Geometry) {
        if geometry.has_colours() {
            if geometry.is_lit {
                self.warnings.push(format!(
                    "{place}: COLOR_0 beside _IRRADIANCE is light of an earlier bake and does not count as a colour"
                ));
            } else {
                self.tally.modelled("primitive with vertex colours");
            }
        }
        if let Some(set) = appearances::missing_set(pattern, geometry) {
            self.warnings.push(format!(
                "{place}: has no TEXCOORD_{set}, which its textures need: they show the texel at (0, 0) everywhere"
            ));
        }
    }

    fn into_scene(self, source: SourceDocument, options: &ImportOptions) -> Result<Scene, ImportProblem> {
        let Self { mut primitives, lights, mut warnings, tally } = self;
        if primitives.iter().all(|placed| placed.geometry.triangles.is_empty()) {
            return Err(ImportProblem::NoTriangles);
        }
        if let Some(distance) = options.weld {
            weld::weld(&mut primitives, distance);
        }
        // Not the lights: a lamp far away must not make the surfaces small.
        let frame = frame::fit(primitives.par_iter().map(|placed| frame::bounds(placed.corners())))?;

        let mut surfaces = Vec::new();
        let (mut degenerate_triangles, mut rounding) = (0, 0f64);
        let flat: Vec<FlatPrimitive> = primitives
            .into_par_iter()
            .map(|placed| FlatPrimitive::new(placed, &frame, options.weld))
            .collect();
        for flat in flat {
            degenerate_triangles += flat.degenerate;
            rounding = rounding.max(flat.rounding);
            if flat.duplicates > 0 {
                let place = &flat.name;
                warnings.push(format!("{place}: {} duplicate triangles dropped", flat.duplicates));
            }
            if !flat.surfaces.is_empty() && flat.is_squeezed {
                return Err(ImportProblem::FlatNode { primitive: flat.name });
            }
            surfaces.extend(flat.surfaces);
        }
        if surfaces.is_empty() {
            return Err(ImportProblem::NoTriangles);
        }
        let shines = |surface: &Surface| surface.exitance != DVec3::ZERO;
        let mut lights: Vec<Light> =
            lights.into_iter().filter_map(|light| light.place(&frame, &mut warnings)).collect();
        let is_dark = options.sky == DVec3::ZERO
            && !surfaces.iter().any(shines)
            && lights.iter().all(|light| light.intensity == DVec3::ZERO);
        if options.needs_light && is_dark {
            return Err(ImportProblem::NoLight);
        }
        let rounding = rounding.max(triangles::rounding_of(frame.centre.abs().max_element() / frame.scale));
        let plane_count = planes::assign(&mut surfaces, &mut lights, rounding);
        let mut scene = Scene {
            source,
            surfaces,
            lights,
            sky: options.sky,
            frame,
            plane_count,
            warnings,
            account: Account::default(),
            degenerate_triangles,
        };
        scene.account = tally.account(&scene);
        Ok(scene)
    }
}

/// A primitive as facets in the frame.
struct FlatPrimitive {
    name: String,
    /// The front, and the back where it is lit; none where no triangle has an area.
    surfaces: Vec<Surface>,
    /// Whether its node has a scale of zero.
    is_squeezed: bool,
    /// How far the rounding of the file's coordinates may have moved a point, frame units.
    rounding: f64,
    degenerate: usize,
    duplicates: usize,
}

impl FlatPrimitive {
    fn new(placed: PlacedPrimitive, frame: &Frame, weld: Option<f64>) -> Self {
        let welded = placed.welded.as_deref().zip(weld);
        let mesh = TriangleMesh::new(&placed.geometry, &placed.world, frame, welded);
        let facets = facets::build(&mesh, &placed.geometry.attributes);
        let TriangleMesh { rounding, degenerate, duplicates, .. } = mesh;
        let surfaces = if facets.is_empty() { Vec::new() } else { placed.surfaces(facets) };
        let is_squeezed = placed.world.matrix3.determinant() == 0.0;
        Self { name: placed.name, surfaces, is_squeezed, rounding, degenerate, duplicates }
    }
}

impl PlacedPrimitive {
    /// World positions of all triangles' corners.
    fn corners(&self) -> impl Iterator<Item = DVec3> {
        let corners = self.geometry.triangles.iter().flatten();
        corners.map(|&vertex| match &self.welded {
            Some(positions) => positions[vertex as usize],
            None => triangles::to_world(&self.world, self.geometry.positions[vertex as usize]),
        })
    }

    /// The surfaces that these facets, seen from the front, are.
    fn surfaces(&self, front: Vec<Facet>) -> Vec<Surface> {
        let look = appearances::look(&self.pattern, &self.geometry, &front);
        let surface = |side, facets| Surface {
            node: self.node,
            primitive: self.primitive,
            side,
            name: self.name.clone(),
            reflectance: look.reflectance,
            exitance: look.exitance,
            opacity: look.opacity,
            appearance: look.appearance.clone(),
            facets,
        };
        let back = self.double_sided.then(|| front.iter().map(facets::turn).collect());
        let front = surface(Side::Front, front);
        [Some(front), back.map(|facets| surface(Side::Back, facets))].into_iter().flatten().collect()
    }
}

/// The triangles of the scene, primitive by primitive in the order of the nodes, up to the one that is too many.
fn read_geometries(
    all_placed: &[PlacedNode],
    sources: &Sources,
    options: &ImportOptions,
) -> Vec<Result<Geometry, ImportProblem>> {
    let mut triangles_left = Some(options.read.max_triangles);
    let primitives: Vec<(&PlacedNode, gltf::Primitive)> = all_placed
        .iter()
        .filter_map(|placed| Some((placed, placed.node.mesh()?)))
        .flat_map(|(placed, mesh)| mesh.primitives().map(move |primitive| (placed, primitive)))
        .filter(|(_, primitive)| primitives::has_triangles(primitive))
        .take_while(|(_, primitive)| {
            triangles_left =
                triangles_left.and_then(|left| left.checked_sub(primitives::triangle_count(primitive)));
            triangles_left.is_some()
        })
        .collect();
    let read = |(placed, primitive): (&PlacedNode, gltf::Primitive)| -> Result<Geometry, ImportProblem> {
        let place = place_of(placed, &primitive);
        let context = Context { place: &place, buffers: sources.buffers, max_bytes: options.read.max_bytes };
        let geometry = primitives::read(&primitive, &context)?;
        check_positions(&geometry, placed, &place)?;
        Ok(geometry)
    };
    primitives.into_par_iter().map(read).collect()
}

/// A primitive in messages.
fn place_of(placed: &PlacedNode, primitive: &gltf::Primitive) -> String {
    format!("{}, primitive {}", node_label(&placed.node), primitive.index())
}

/// NaN and infinity are caught in the file's numbers, overflow in the transformed ones.
fn check_positions(geometry: &Geometry, placed: &PlacedNode, place: &str) -> Result<(), ImportProblem> {
    let is_finite = |&position: &[f32; 3]| triangles::to_world(&placed.world, position).is_finite();
    match geometry.positions.iter().position(|position| !is_finite(position)) {
        Some(vertex) => Err(ImportProblem::NonFinitePosition { place: place.to_owned(), vertex }),
        None => Ok(()),
    }
}
