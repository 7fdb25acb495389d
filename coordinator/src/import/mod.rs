//! glTF in, scene out.
//!
//! | module | step |
//! |---|---|
//! | `document` | bytes to a validated document |
//! | `buffers` | its buffers, from the file or next to it |
//! | `nodes` | the nodes of the scene and their world matrices |
//! | `accessors`, `primitives` | vertex data and triangles of each primitive |
//! | `materials`, `lights` | reflectance, exitance, intensity |
//! | `frame`, `triangles` | triangles in the frame, welded |
//! | `facets` | flat convex pieces |
//! | `planes` | which of them are coplanar |
//!
//! Files are not trusted: whatever the bytes, the answer is a scene or an [`ImportError`].

mod accessors;
mod buffers;
mod document;
mod error;
mod facets;
mod frame;
mod lights;
mod materials;
mod nodes;
mod planes;
mod primitives;
mod triangles;

#[cfg(test)]
mod test_document;
#[cfg(test)]
mod tests;

use std::path::Path;

use glam::{DAffine3, DVec3};
use gltf::Document;

pub use self::error::{ImportError, ImportProblem};

use self::accessors::Context;
use self::lights::WorldLight;
use self::materials::{Diffuse, Materials};
use self::nodes::{PlacedNode, node_label};
use self::primitives::Geometry;
use self::triangles::TriangleMesh;
use crate::scene::{Scene, Side, SourceDocument, Surface};

/// Name of a scene in messages that did not come from a file.
const UNNAMED: &str = "the glTF";

/// Limits for files that are not trusted, or just too large for the machine.
#[derive(Debug, Clone)]
pub struct ImportOptions {
    /// Most bytes of the file and its external buffers together. 4 GiB unless told otherwise.
    pub max_bytes: u64,
    /// Most triangles in the scene, counted where they stand: a mesh counts once for every node that shows it. 50 million
    /// unless told otherwise.
    pub max_triangles: usize,
    /// Whether a scene without any light is an error. It is unless told otherwise: a bake of it would be black.
    pub needs_light: bool,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self { max_bytes: 4 << 30, max_triangles: 50_000_000, needs_light: true }
    }
}

/// Imports a .glb or .gltf file. External buffers are read from the file's folder or below, never from elsewhere.
pub fn import(path: &Path, options: &ImportOptions) -> Result<Scene, ImportError> {
    let file = path.display().to_string();
    let fail = |problem| ImportError::new(&file, problem);
    let bytes = buffers::read_file(path, options.max_bytes)
        .map_err(|error| fail(ImportProblem::Unreadable(error)))?
        .ok_or_else(|| fail(ImportProblem::TooLarge { limit: options.max_bytes }))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    read_scene(&bytes, Some(folder), options).map_err(fail)
}

/// Imports a glTF from memory. Data URIs are read, references to files refused.
pub fn import_slice(bytes: &[u8], options: &ImportOptions) -> Result<Scene, ImportError> {
    let fail = |problem| ImportError::new(UNNAMED, problem);
    if bytes.len() as u64 > options.max_bytes {
        return Err(fail(ImportProblem::TooLarge { limit: options.max_bytes }));
    }
    read_scene(bytes, None, options).map_err(fail)
}

fn read_scene(bytes: &[u8], folder: Option<&Path>, options: &ImportOptions) -> Result<Scene, ImportProblem> {
    let (document, blob) = document::parse(bytes)?;
    let budget = options.max_bytes - bytes.len() as u64;
    let buffers = buffers::resolve(&document, blob, folder, budget, options.max_bytes)?;
    let mut content = Content::default();
    document::warn_ignored_extensions(document.as_json(), &mut content.warnings);
    content.collect(&document, &buffers, options)?;
    content.into_scene(SourceDocument { root: document.into_json(), buffers }, options.needs_light)
}

/// A primitive of a node, before the frame is known.
struct PlacedPrimitive {
    node: usize,
    primitive: usize,
    name: String,
    world: DAffine3,
    geometry: Geometry,
    diffuse: Diffuse,
    double_sided: bool,
}

/// What the nodes of the scene hold.
#[derive(Default)]
struct Content {
    primitives: Vec<PlacedPrimitive>,
    lights: Vec<WorldLight>,
    warnings: Vec<String>,
}

impl Content {
    fn collect(
        &mut self,
        document: &Document,
        buffers: &[Vec<u8>],
        options: &ImportOptions,
    ) -> Result<(), ImportProblem> {
        let mut materials = Materials::default();
        let mut triangles_left = options.max_triangles;
        for placed in nodes::walk(document)? {
            self.lights.extend(lights::read(&placed, &mut self.warnings)?);
            let Some(mesh) = placed.node.mesh() else { continue };
            if placed.node.skin().is_some() {
                self.warnings
                    .push(format!("{}: skin ignored, the mesh stays as modelled", node_label(&placed.node)));
            }
            for primitive in mesh.primitives() {
                let place = format!("{}, primitive {}", node_label(&placed.node), primitive.index());
                if !primitives::has_triangles(&primitive) {
                    self.warnings.push(format!("{place}: points and lines left out, only triangles are lit"));
                    continue;
                }
                let (limit, count) = (options.max_triangles, primitives::triangle_count(&primitive));
                triangles_left = triangles_left
                    .checked_sub(count)
                    .ok_or_else(|| ImportProblem::TooManyTriangles { place: place.clone(), limit })?;
                let context = Context { place: &place, buffers, max_bytes: options.max_bytes };
                let geometry = primitives::read(&primitive, &context)?;
                check_positions(&geometry, &placed, &place)?;
                let material = primitive.material();
                let diffuse = materials.diffuse(&material, &mut self.warnings)?;
                self.primitives.push(PlacedPrimitive {
                    node: placed.node.index(),
                    primitive: primitive.index(),
                    name: place,
                    world: placed.world,
                    geometry,
                    diffuse,
                    double_sided: material.double_sided(),
                });
            }
        }
        Ok(())
    }

    fn into_scene(self, source: SourceDocument, needs_light: bool) -> Result<Scene, ImportProblem> {
        let Self { primitives, lights, mut warnings } = self;
        if primitives.iter().all(|placed| placed.geometry.triangles.is_empty()) {
            return Err(ImportProblem::NoTriangles);
        }
        let positions = primitives.iter().flat_map(PlacedPrimitive::corners);
        // Not the lights: a lamp far away must not make the surfaces small.
        let frame = frame::fit(positions)?;

        let mut surfaces = Vec::new();
        let (mut degenerate_triangles, mut rounding) = (0, 0f64);
        for placed in primitives {
            let mesh = TriangleMesh::new(&placed.geometry, &placed.world, &frame);
            degenerate_triangles += mesh.degenerate;
            rounding = rounding.max(mesh.rounding);
            if mesh.duplicates > 0 {
                warnings.push(format!("{}: {} duplicate triangles dropped", placed.name, mesh.duplicates));
            }
            if !mesh.triangles.is_empty() && placed.world.matrix3.determinant() == 0.0 {
                return Err(ImportProblem::FlatNode { primitive: placed.name });
            }
            if !mesh.triangles.is_empty() {
                placed.add_surfaces(&mesh, &mut surfaces);
            }
        }
        if surfaces.is_empty() {
            return Err(ImportProblem::NoTriangles);
        }
        let shines = |surface: &Surface| surface.exitance != DVec3::ZERO;
        let is_dark =
            !surfaces.iter().any(shines) && !lights.iter().any(|light| light.intensity != DVec3::ZERO);
        if needs_light && is_dark {
            return Err(ImportProblem::NoLight);
        }
        let rounding = rounding.max(triangles::rounding_of(frame.centre.abs().max_element() / frame.scale));
        let plane_count = planes::assign(&mut surfaces, rounding);
        let point_lights = lights.into_iter().map(|light| light.place(&frame)).collect();
        Ok(Scene { source, surfaces, point_lights, frame, plane_count, warnings, degenerate_triangles })
    }
}

impl PlacedPrimitive {
    /// World positions of all triangles' corners.
    fn corners(&self) -> impl Iterator<Item = DVec3> {
        let corners = self.geometry.triangles.iter().flatten();
        corners.map(|&vertex| triangles::to_world(&self.world, self.geometry.positions[vertex as usize]))
    }

    fn add_surfaces(&self, mesh: &TriangleMesh, surfaces: &mut Vec<Surface>) {
        let surface = |side, facets| Surface {
            node: self.node,
            primitive: self.primitive,
            side,
            name: self.name.clone(),
            reflectance: self.diffuse.reflectance,
            exitance: self.diffuse.exitance,
            facets,
        };
        let front = facets::build(mesh, &self.geometry.attributes);
        let back = self.double_sided.then(|| front.iter().map(facets::turn).collect());
        surfaces.push(surface(Side::Front, front));
        surfaces.extend(back.map(|facets| surface(Side::Back, facets)));
    }
}

/// NaN and infinity are caught in the file's numbers, overflow in the transformed ones.
fn check_positions(geometry: &Geometry, placed: &PlacedNode, place: &str) -> Result<(), ImportProblem> {
    let is_finite = |&position: &[f32; 3]| triangles::to_world(&placed.world, position).is_finite();
    match geometry.positions.iter().position(|position| !is_finite(position)) {
        Some(vertex) => Err(ImportProblem::NonFinitePosition { place: place.to_owned(), vertex }),
        None => Ok(()),
    }
}
