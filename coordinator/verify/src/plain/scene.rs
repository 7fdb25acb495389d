//! Triangles, materials and lights of a scene, in the world.

use std::collections::{BTreeSet, HashSet};
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use gltf::{Material, Semantic};

use super::appearance::{Appearances, MAX_REFLECTANCE, PlainAppearance, PlainMaterial, material_name};
use super::source::{Geometry, PlainDocument, has_triangles, label};
use super::{PlainError, PlainLight};
use document::EXT_LIGHTS_AREA;
use document::sky::SkyImage;
use document::{ImportError, ImportProblem, LightUnit, ReadOptions};

/// Height over longest edge below which a triangle has no area to speak of.
const LEAST_HEIGHT: f64 = 1e-10;

/// Cosine of the deviation (one degree) from which a normal of the file is smooth shading.
const SMOOTH_COSINE: f64 = 0.999_847_695;

/// Cosine (31 degrees) down to which a bake follows it.
const LEAST_NORMAL_COSINE: f64 = 0.857_167_3;

/// A scene as plain triangles.
#[derive(Debug, Clone, Default)]
pub struct PlainScene {
    /// The material of each primitive of triangles without its textures, in the order in which a walk of the scene's nodes meets them.
    pub materials: Vec<PlainMaterial>,
    /// All triangles that have an area, each once.
    pub triangles: Vec<PlainTriangle>,
    /// Textures and vertex colours of each primitive; `None` where it is uniform.
    pub appearances: Vec<Option<PlainAppearance>>,
    /// Lights that are no surface.
    pub lights: Vec<PlainLight>,
    /// Radiance of the sky, the same from all directions. Under an image, its factor.
    pub sky: DVec3,
    /// Radiance of the sky by direction.
    pub sky_image: Option<Arc<SkyImage>>,
    /// Warnings on what is not modelled.
    pub warnings: Vec<String>,
}

/// A triangle in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlainTriangle {
    /// Counter-clockwise seen from the front.
    pub corners: [DVec3; 3],
    /// Index of its primitive's material.
    pub primitive: usize,
    /// The primitive's vertices that its corners are.
    pub vertices: [usize; 3],
}

impl PlainTriangle {
    /// Normal of the front, as long as the area.
    #[must_use]
    pub fn area_vector(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a) * 0.5
    }
}

/// How a scene is read.
#[derive(Debug, Clone, Default)]
pub struct PlainOptions {
    /// Which scene of the file, and which files beside it may be read.
    pub read: ReadOptions,
    /// Unit of the file's light intensities.
    pub light_unit: LightUnit,
    /// Radiance of a uniform sky. Under an image, its factor.
    pub sky: DVec3,
    /// Radiance of the sky by direction [default: that of the file, if `sky` is 0].
    pub sky_image: Option<Arc<SkyImage>>,
}

impl PlainScene {
    /// Reads a .glb or .gltf file.
    ///
    /// # Errors
    /// When a file cannot be read, is not a glTF, or holds no triangle; when a material or light means nothing.
    pub fn open(path: &Path) -> Result<Self, PlainError> {
        Self::open_with(path, &PlainOptions::default())
    }

    /// Reads a .glb or .gltf file with options.
    ///
    /// # Errors
    /// As [`PlainScene::open`]; when there is no such scene.
    pub fn open_with(path: &Path, options: &PlainOptions) -> Result<Self, PlainError> {
        let mut document = PlainDocument::open(path, &options.read)?;
        let mut scene = Self { sky: options.sky, sky_image: options.sky_image.clone(), ..Self::default() };
        let mut appearances = Appearances::default();
        // Each is said once, in alphabetical order.
        let mut warnings: BTreeSet<String> = std::mem::take(&mut document.warnings).into_iter().collect();
        if options.sky == DVec3::ZERO
            && let Some((image, factor)) = document.sky.take()
        {
            scene.sky = DVec3::splat(factor);
            scene.sky_image = Some(Arc::new(image));
        }
        for (primitive, (node, source)) in document.primitives().into_iter().enumerate() {
            let geometry = document.geometry(&node, &source)?;
            let count = geometry.positions.len();
            let appearance = appearances.read(&document, &node, &source, count, &mut warnings)?;
            scene.materials.push(read_material(&document, &source.material(), &appearance, &mut warnings)?);
            scene.appearances.push(Some(appearance).filter(|appearance| !appearance.is_uniform()));
            if let Some(normals) = source.get(&Semantic::Normals) {
                let local = document.vectors(&node, Some(normals), "NORMAL")?;
                if is_smooth(
                    &document.vectors(&node, source.get(&Semantic::Positions), "POSITION")?,
                    &local,
                    &geometry.triangles,
                ) {
                    warnings.insert(format!(
                        "{}: smooth normals ignored, triangles are taken as flat",
                        label(&node)
                    ));
                }
            }
            let triangles = whole_triangles(&geometry);
            scene.triangles.extend(triangles.map(|(vertices, corners)| PlainTriangle {
                corners,
                primitive,
                vertices,
            }));
        }
        scene.read_lights(&document, options.light_unit, &mut warnings)?;
        warn_unmodelled(&document, &mut warnings);
        scene.warnings = document::joined_warnings(warnings.into_iter().collect());
        if scene.triangles.is_empty() {
            return Err(PlainError::NoTriangles(path.to_owned()));
        }
        Ok(scene)
    }

    /// The material at a point of a triangle, in the world.
    #[must_use]
    pub fn material_at(&self, triangle: &PlainTriangle, point: DVec3) -> PlainMaterial {
        match self.appearances.get(triangle.primitive) {
            Some(Some(appearance)) => appearance.at(triangle.vertices, weights(&triangle.corners, point)),
            _ => self.materials[triangle.primitive],
        }
    }

    fn read_lights(
        &mut self,
        document: &PlainDocument,
        unit: LightUnit,
        warnings: &mut BTreeSet<String>,
    ) -> Result<(), PlainError> {
        for node in document.nodes() {
            let world = document.placement(&node);
            let punctual = node.light().map(|light| PlainLight::read(&light, world, unit));
            let area = node.extension_value(EXT_LIGHTS_AREA);
            let area =
                area.map(|reference| PlainLight::read_area(&document.document, reference, world)).transpose();
            let area = area.map_err(|detail| {
                let problem =
                    ImportProblem::Light { place: label(&node), extension: EXT_LIGHTS_AREA, detail };
                PlainError::File(ImportError::new(&document.path().display().to_string(), problem))
            })?;
            for placed in [punctual, area].into_iter().flatten() {
                let Some(placed) = placed else {
                    warnings.insert(format!("{}: light left out, it has no direction", label(&node)));
                    continue;
                };
                check(document, label(&node), "the light's intensity", placed.intensity)?;
                self.lights.push(placed);
            }
        }
        Ok(())
    }
}

/// Barycentric coordinates of a point in the plane of a triangle.
fn weights([a, b, c]: &[DVec3; 3], point: DVec3) -> DVec3 {
    let normal = (*b - *a).cross(*c - *a);
    let part = |from: DVec3, to: DVec3| normal.dot((to - from).cross(point - from)) / normal.length_squared();
    DVec3::new(part(*b, *c), part(*c, *a), part(*a, *b))
}

fn read_material(
    document: &PlainDocument,
    material: &Material<'_>,
    appearance: &PlainAppearance,
    warnings: &mut BTreeSet<String>,
) -> Result<PlainMaterial, PlainError> {
    let name = material_name(material);
    let reflectance = appearance.reflectance();
    check(document, name.clone(), "reflectance", reflectance)?;
    check(document, name.clone(), "emission", appearance.exitance)?;
    if reflectance.max_element() >= 1.0 {
        warnings.insert(format!("{name}: reflectance clamped to {MAX_REFLECTANCE}"));
    }
    Ok(appearance.plain())
}

fn check(
    document: &PlainDocument,
    place: String,
    what: &'static str,
    value: DVec3,
) -> Result<(), PlainError> {
    if value.is_finite() && value.min_element() >= 0.0 {
        return Ok(());
    }
    Err(PlainError::Factor { path: document.path().to_owned(), place, what, signed: false })
}

fn warn_unmodelled(document: &PlainDocument, warnings: &mut BTreeSet<String>) {
    let ignored: Vec<&str> =
        document.document.extensions_used().filter(|name| !document::is_understood(name)).collect();
    if !ignored.is_empty() {
        warnings.insert(format!("extensions ignored: {}", ignored.join(", ")));
    }
    for node in document.nodes() {
        let mut primitives = node.mesh().into_iter().flat_map(|mesh| mesh.primitives());
        if primitives.any(|primitive| !has_triangles(&primitive)) {
            warnings.insert(format!("{}: points and lines left out, only triangles are lit", label(&node)));
        }
    }
}

/// Vertices and corners of those triangles that have an area, each triangle once.
fn whole_triangles(geometry: &Geometry) -> impl Iterator<Item = ([usize; 3], [DVec3; 3])> {
    let mut seen = HashSet::new();
    geometry
        .triangles
        .iter()
        .map(|vertices| (*vertices, vertices.map(|vertex| geometry.positions[vertex])))
        .filter(move |(_, corners)| {
            let [a, b, c] = *corners;
            let longest = [b - a, c - b, a - c].map(DVec3::length_squared).into_iter().fold(0.0, f64::max);
            let has_area = (b - a).cross(c - a).length() > LEAST_HEIGHT * longest;
            // The same three corners in the same turn, from whichever they start; adding zero makes a negative zero positive.
            let bits = corners.map(|corner| (corner + DVec3::ZERO).to_array().map(f64::to_bits));
            let turns = [bits, [bits[1], bits[2], bits[0]], [bits[2], bits[0], bits[1]]];
            has_area && turns.into_iter().min().is_some_and(|turn| seen.insert(turn))
        })
}

/// Whether the file's normals deviate from those of the triangles, in the node's coordinates.
fn is_smooth(positions: &[DVec3], normals: &[DVec3], triangles: &[[usize; 3]]) -> bool {
    triangles.iter().any(|triangle| {
        let [a, b, c] = triangle.map(|corner| positions[corner]);
        let flat = (b - a).cross(c - a).normalize_or_zero();
        let deviates = |corner: usize| {
            // Mirrored nodes have their triangles turned round, not their normals.
            let cosine = normals.get(corner).map_or(1.0, |normal| normal.normalize_or_zero().dot(flat).abs());
            cosine > LEAST_NORMAL_COSINE && cosine < SMOOTH_COSINE
        };
        triangle.iter().any(|&corner| deviates(corner))
    })
}
