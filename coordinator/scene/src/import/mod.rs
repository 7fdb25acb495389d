//! glTF in, scene out. [`document`] parses and decompresses the file; these modules do the rest, in this order:
//!
//! | module | step |
//! |---|---|
//! | `primitives` | vertex data and triangles of each primitive |
//! | `materials`, `lights` | reflectance, exitance, intensity |
//! | `weld` | merges nearby vertices, on request |
//! | `extremes` | parts too small and lights too bright for the scene |
//! | `placed` | primitives in the frame |
//! | `frame`, `triangles` | triangles in the frame, without duplicates |
//! | `facets` | flat convex pieces |
//! | `blender` | units of lamps in files of Blender |
//! | `averaged` | materials averaged over surfaces, with textures and vertex colours |
//! | `planes` | coplanar facets |
//! | `layers` | of coplanar facets on one another, all but the first cut away |
//! | `tally` | the import report |
//! | `lit` | files that are lit already, for pictures |
//!
//! Files are not trusted: whatever the bytes, the answer is a scene or an [`ImportError`].

mod averaged;
mod blender;
mod extremes;
mod facets;
mod frame;
mod layers;
mod lights;
mod lit;
mod materials;
mod placed;
mod planes;
mod primitives;
mod sealed;
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

use document::sky::{sky_of, take_sky_image};
use document::{ImportError, ImportProblem, LightUnit, PlainDocument, ReadOptions};
use glam::DVec3;
use kernel::geometry::Bounds;
use rayon::prelude::*;

pub use self::lit::{LitDocument, LitPrimitive, import_lit};
pub use self::primitives::triangles as triangle_list;

use self::extremes::Extents;
use self::lights::WorldLight;
use self::materials::Materials;
use self::placed::{FlatPrimitive, PlacedPrimitive};
use self::primitives::Geometry;
use self::tally::Tally;
use crate::appearance::Pattern;
use crate::light::Light;
use crate::model::{Scene, SourceDocument, Surface};
use crate::report::ImportReport;
use crate::sky::SkyPattern;
use document::accessors::Context;
use document::images;
use document::labels::node_label;
use document::nodes::{self, PlacedNode};

/// Name in messages of a scene from memory.
const UNNAMED: &str = "the glTF";

/// How a file is imported.
#[derive(Debug, Clone)]
pub struct ImportOptions {
    /// Which scene of the file, and limits of size.
    pub read: ReadOptions,
    /// Distance, in the file's units, within which vertices are merged first [default: only equal ones are].
    pub weld: Option<f64>,
    /// Whether a scene without any light is an error [default: yes; its bake would be black].
    pub needs_light: bool,
    /// Unit of the file's light intensities.
    pub light_unit: LightUnit,
    /// Radiance of a uniform sky around the scene, W/(m^2 sr) or cd/m^2; finite, not negative [default: 0]. Under a pattern, its
    /// mean.
    pub sky: DVec3,
    /// How the radiance of the sky differs by direction, relative to its mean [default: as in the file, if it has a sky and `sky` is 0].
    pub sky_pattern: Option<Arc<SkyPattern>>,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self {
            read: ReadOptions::default(),
            weld: None,
            needs_light: true,
            light_unit: LightUnit::Candela,
            sky: DVec3::ZERO,
            sky_pattern: None,
        }
    }
}

/// Imports a .glb or .gltf file. External buffers are read from the file's folder or below, never from elsewhere.
///
/// # Errors
/// When the file cannot be read, or holds no scene that can be baked.
pub fn import(path: &Path, options: &ImportOptions) -> Result<Scene, ImportError> {
    let file = document::open(path, &options.read)?;
    scene_of(file, options).map_err(|problem| ImportError::new(&path.display().to_string(), problem))
}

/// Imports a glTF from memory. Data URIs are read, references to files refused.
///
/// # Errors
/// As [`import`].
pub fn import_slice(bytes: &[u8], options: &ImportOptions) -> Result<Scene, ImportError> {
    let scene = document::read(bytes, None, &options.read).and_then(|file| scene_of(file, options));
    scene.map_err(|problem| ImportError::new(UNNAMED, problem))
}

fn scene_of(mut file: PlainDocument, options: &ImportOptions) -> Result<Scene, ImportProblem> {
    let mut content = Content { warnings: std::mem::take(&mut file.warnings), ..Content::default() };
    document::warn_ignored_extensions(file.document.as_json(), &mut content.warnings);
    content.collect(&file, options)?;
    content.sky = options.sky;
    content.sky_pattern = options.sky_pattern.clone();
    if options.sky == DVec3::ZERO
        && let Some((image, factor)) = sky_of(&file, &mut content.warnings)?
    {
        let pattern = SkyPattern::new(&image);
        content.sky = pattern.mean() * factor;
        content.sky_pattern = Some(Arc::new(pattern));
    }
    let mut root = file.document.into_json();
    document::require_again(&mut root, file.required);
    take_sky_image(&mut root);
    let source =
        SourceDocument { root, buffers: file.buffers, folder: file.folder, is_meshopt: file.is_meshopt };
    content.into_scene(source, options)
}

/// Primitives and lights of the scene's nodes.
#[derive(Default)]
struct Content {
    primitives: Vec<PlacedPrimitive>,
    lights: Vec<WorldLight>,
    /// Lights of the file whose range was ignored, with a warning.
    ranged: BTreeSet<usize>,
    sky: DVec3,
    sky_pattern: Option<Arc<SkyPattern>>,
    warnings: Vec<String>,
    tally: Tally,
}

impl Content {
    fn collect(&mut self, file: &PlainDocument, options: &ImportOptions) -> Result<(), ImportProblem> {
        let (all_placed, hidden): (Vec<_>, Vec<_>) =
            nodes::walk(&file.document)?.into_iter().partition(|placed| placed.is_visible);
        let hidden = hidden.iter().filter(|placed| placed.node.mesh().is_some()).count();
        if hidden > 0 {
            self.warnings
                .push(format!("nodes with a mesh left out, since KHR_node_visibility hides them: {hidden}"));
        }
        let mut materials = self.materials(file, &all_placed);
        let mut geometries = read_geometries(&all_placed, &file.buffers, options).into_iter();
        for placed in all_placed {
            self.lights.extend(lights::read(
                &file.document,
                &placed,
                options.light_unit,
                &mut self.ranged,
                &mut self.warnings,
            )?);
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
                self.check_vertices(&place, &pattern, &geometry);
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

    /// The materials in use, with their images decoded.
    fn materials(&mut self, file: &PlainDocument, placed: &[PlacedNode]) -> Materials {
        let meshes = placed.iter().filter_map(|placed| placed.node.mesh());
        let primitives = meshes.flat_map(|mesh| mesh.primitives()).filter(primitives::has_triangles);
        let mut in_use: Vec<gltf::Material> = primitives.map(|primitive| primitive.material()).collect();
        in_use.sort_by_key(gltf::Material::index);
        in_use.dedup_by_key(|material| material.index());
        let needed: BTreeSet<usize> = in_use.iter().flat_map(materials::needed_images).collect();
        Materials::new(images::decode(file, &needed, &mut self.warnings))
    }

    /// Counts vertex colours; warns where they are light, or texture coordinates are missing.
    fn check_vertices(&mut self, place: &str, pattern: &Pattern, geometry: &Geometry) {
        if geometry.has_colours() {
            if geometry.is_lit {
                self.warnings.push(format!(
                    "{place}: COLOR_0 beside _IRRADIANCE is light of an earlier bake and does not count as a colour"
                ));
            } else {
                self.tally.modelled("primitive with vertex colours");
            }
        }
        if let Some(set) = averaged::missing_set(pattern, geometry) {
            self.warnings.push(format!(
                "{place}: has no TEXCOORD_{set}, which its textures need: they show the texel at (0, 0) everywhere"
            ));
        }
    }

    fn into_scene(self, source: SourceDocument, options: &ImportOptions) -> Result<Scene, ImportProblem> {
        let Self { mut primitives, lights, sky, sky_pattern, mut warnings, tally, .. } = self;
        if primitives.iter().all(|placed| placed.geometry.triangles.is_empty()) {
            return Err(ImportProblem::NoTriangles);
        }
        if let Some(distance) = options.weld {
            weld::weld(&mut primitives, distance);
        }
        // Not the lights: a lamp far away must not make the surfaces small.
        let boxes: Vec<Bounds> =
            primitives.par_iter().map(|placed| Bounds::around(placed.corners())).collect();
        let frame = frame::fit(boxes.par_iter().copied())?;
        Extents::new(&primitives, &boxes).check(&mut warnings)?;
        lights.iter().try_for_each(|light| extremes::check_light(light, &frame))?;

        let mut surfaces = Vec::new();
        let (mut degenerate_triangles, mut rounding) = (0, 0f64);
        let flat: Vec<FlatPrimitive> = primitives
            .into_par_iter()
            .map(|placed| FlatPrimitive::new(placed, &frame, options.weld))
            .collect();
        let mut duplicates = vec![];
        for flat in flat {
            degenerate_triangles += flat.degenerate;
            rounding = rounding.max(flat.rounding);
            if flat.duplicates > 0 {
                let triangles = if flat.duplicates == 1 { "triangle" } else { "triangles" };
                duplicates.push(format!("{}: {} duplicate {triangles} dropped", flat.name, flat.duplicates));
            }
            if !flat.surfaces.is_empty() && flat.is_squeezed {
                return Err(ImportProblem::FlatNode { primitive: flat.name });
            }
            surfaces.extend(flat.surfaces);
        }
        if surfaces.is_empty() {
            return Err(ImportProblem::NoTriangles);
        }
        let duplicates = document::joined_warnings(duplicates);
        warnings.extend(document::first_warnings(duplicates, "warnings of duplicate triangles"));
        let shines = |surface: &Surface| surface.exitance != DVec3::ZERO;
        let mut lights: Vec<Light> =
            lights.into_iter().filter_map(|light| light.place(&frame, &mut warnings)).collect();
        let is_dark = sky == DVec3::ZERO
            && !surfaces.iter().any(shines)
            && lights.iter().all(|light| light.intensity == DVec3::ZERO);
        if options.needs_light && is_dark {
            return Err(ImportProblem::NoLight);
        }
        let rounding = rounding.max(triangles::rounding_of(frame.centre.abs().max_element() / frame.scale));
        let plane_count = planes::assign(&mut surfaces, &mut lights, rounding);
        // Before layers are cut: where one hides a part of a body, it closes the body in its stead.
        sealed::mark(&mut surfaces, &lights);
        let mut warnings = document::joined_warnings(warnings);
        warnings.extend(layers::cut(&mut surfaces, plane_count, planes::tolerance(rounding), &frame));
        let vertex_count = surfaces.par_iter().map(Surface::vertex_count).sum();
        let lit_vertices: usize = surfaces.par_iter().map(Surface::lit_vertex_count).sum();
        let mut scene = Scene {
            source,
            vertex_count,
            sealed_vertex_count: vertex_count - lit_vertices,
            surfaces,
            lights,
            sky,
            sky_pattern,
            frame,
            plane_count,
            warnings,
            import_report: ImportReport::default(),
            degenerate_triangles,
        };
        scene.import_report = tally.report(&scene);
        scene.warnings.extend(blender::check_units(&scene, options.light_unit));
        Ok(scene)
    }
}

/// The geometry of each primitive, in the order of the nodes, up to the triangle limit.
fn read_geometries(
    all_placed: &[PlacedNode],
    buffers: &[Vec<u8>],
    options: &ImportOptions,
) -> Vec<Result<Geometry, ImportProblem>> {
    let held = buffers.iter().map(Vec::len).sum();
    let mut triangles_left = Some(options.read.max_triangles);
    let primitives: Vec<(&PlacedNode, gltf::Primitive)> = all_placed
        .iter()
        .filter_map(|placed| Some((placed, placed.node.mesh()?)))
        .flat_map(|(placed, mesh)| mesh.primitives().map(move |primitive| (placed, primitive)))
        .filter(|(_, primitive)| primitives::has_triangles(primitive))
        .take_while(|(_, primitive)| {
            // Vertices that no triangle has take memory, too; those beyond the bytes of the file are refused when they are read.
            let vertices = primitives::vertex_count(primitive).min(held);
            let count = primitives::triangle_count(primitive).max(vertices / 3);
            triangles_left = triangles_left.and_then(|left| left.checked_sub(count));
            triangles_left.is_some()
        })
        .collect();
    let read = |(placed, primitive): (&PlacedNode, gltf::Primitive)| -> Result<Geometry, ImportProblem> {
        let place = place_of(placed, &primitive);
        let context = Context { place: &place, buffers };
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
