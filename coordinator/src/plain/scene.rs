//! Triangles, materials and point lights of a scene, in the world.

use std::collections::{BTreeSet, HashSet};
use std::f64::consts::PI;
use std::path::Path;

use glam::DVec3;
use gltf::khr_lights_punctual::Kind;
use gltf::material::AlphaMode;
use gltf::{Material, Semantic};

use super::PlainError;
use super::document::{Geometry, PlainDocument, has_triangles, label};

/// Largest reflectance, as the bake has it: at 1 light in a closed scene would never be absorbed.
const MAX_REFLECTANCE: f64 = 0.999;

/// Height over longest edge below which a triangle has no area to speak of.
const LEAST_HEIGHT: f64 = 1e-10;

/// Cosine of the deviation (one degree) from which a normal of the file is smooth shading.
const SMOOTH_COSINE: f64 = 0.999_847_695;

/// A scene as plain triangles.
#[derive(Debug, Clone, Default)]
pub struct PlainScene {
    /// The material of each primitive of triangles, in the order in which a walk of the scene's nodes meets them.
    pub materials: Vec<PlainMaterial>,
    /// All triangles that have an area, each once.
    pub triangles: Vec<PlainTriangle>,
    /// Isotropic point lights.
    pub point_lights: Vec<PlainLight>,
    /// What is not modelled and was left out, in words for the user.
    pub warnings: Vec<String>,
}

/// What a primitive is made of; linear RGB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlainMaterial {
    /// Diffuse reflectance, base colour x (1 - metallic), under 1.
    pub reflectance: DVec3,
    /// Emitted exitance, pi x emissive factor x strength, W/m^2.
    pub exitance: DVec3,
    /// Whether the back is as the front; else it reflects and emits nothing.
    pub double_sided: bool,
}

/// A triangle in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlainTriangle {
    /// Counter-clockwise seen from the front.
    pub corners: [DVec3; 3],
    /// Index of its primitive's material.
    pub primitive: usize,
}

impl PlainTriangle {
    /// Along the normal of the front, as long as the area is large.
    #[must_use]
    pub fn area_vector(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a) * 0.5
    }
}

/// An isotropic point light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlainLight {
    /// Position in the world.
    pub position: DVec3,
    /// Radiant intensity, W/sr.
    pub intensity: DVec3,
}

impl PlainScene {
    /// Reads a .glb or .gltf file.
    ///
    /// # Errors
    /// When a file cannot be read, is no valid glTF, or holds no triangle; when a material or light means nothing.
    pub fn open(path: &Path) -> Result<Self, PlainError> {
        let document = PlainDocument::open(path)?;
        let mut scene = Self::default();
        // Each is said once, in alphabetical order.
        let mut warnings = BTreeSet::new();
        for (primitive, (node, source)) in document.primitives().into_iter().enumerate() {
            scene.materials.push(read_material(&document, &source.material(), &mut warnings)?);
            let geometry = document.geometry(&node, &source)?;
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
            scene
                .triangles
                .extend(whole_triangles(&geometry).map(|corners| PlainTriangle { corners, primitive }));
        }
        scene.read_lights(&document, &mut warnings)?;
        warn_unmodelled(&document, &mut warnings);
        scene.warnings = warnings.into_iter().collect();
        if scene.triangles.is_empty() {
            return Err(PlainError::NoTriangles(path.to_owned()));
        }
        Ok(scene)
    }

    fn read_lights(
        &mut self,
        document: &PlainDocument,
        warnings: &mut BTreeSet<String>,
    ) -> Result<(), PlainError> {
        for node in document.nodes() {
            let Some(light) = node.light() else { continue };
            if !matches!(light.kind(), Kind::Point) {
                warnings.insert(format!(
                    "{}: spot or directional light left out, not modelled; use a point light or an emissive surface",
                    label(&node)
                ));
                continue;
            }
            let intensity = DVec3::from_array(light.color().map(f64::from)) * f64::from(light.intensity());
            check(document, label(&node), "the light's intensity", intensity)?;
            self.point_lights.push(PlainLight { position: document.position(&node), intensity });
        }
        Ok(())
    }
}

fn read_material(
    document: &PlainDocument,
    material: &Material<'_>,
    warnings: &mut BTreeSet<String>,
) -> Result<PlainMaterial, PlainError> {
    let name = match (material.name(), material.index()) {
        (Some(name), _) => format!("material {name}"),
        (None, Some(index)) => format!("material {index}"),
        (None, None) => "the default material".to_owned(),
    };
    let pbr = material.pbr_metallic_roughness();
    let [r, g, b, _] = pbr.base_color_factor().map(f64::from);
    let reflectance = DVec3::new(r, g, b) * (1.0 - f64::from(pbr.metallic_factor()));
    let strength = f64::from(material.emissive_strength().unwrap_or(1.0));
    let exitance = DVec3::from_array(material.emissive_factor().map(f64::from)) * strength * PI;
    check(document, name.clone(), "reflectance", reflectance)?;
    check(document, name.clone(), "emission", exitance)?;
    if reflectance.max_element() >= 1.0 {
        warnings.insert(format!("{name}: reflectance clamped to {MAX_REFLECTANCE}"));
    }
    if material.alpha_mode() != AlphaMode::Opaque {
        warnings.insert(format!("{name}: transparency is ignored, it blocks all light"));
    }
    let textured = pbr.base_color_texture().is_some()
        || pbr.metallic_roughness_texture().is_some()
        || material.emissive_texture().is_some()
        || material.normal_texture().is_some()
        || material.occlusion_texture().is_some();
    if textured {
        warnings.insert(format!("{name}: textures ignored, only its factors count"));
    }
    let reflectance = reflectance.min(DVec3::splat(MAX_REFLECTANCE));
    Ok(PlainMaterial { reflectance, exitance, double_sided: material.double_sided() })
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
    let understood = |name: &String| gltf::json::extensions::ENABLED_EXTENSIONS.contains(&name.as_str());
    let ignored: Vec<&str> =
        document.gltf.extensions_used().filter(|name| !understood(&(*name).to_owned())).collect();
    if !ignored.is_empty() {
        warnings.insert(format!("extensions ignored: {}", ignored.join(", ")));
    }
    for node in document.nodes() {
        if node.skin().is_some() {
            warnings.insert(format!("{}: skin ignored, the mesh stays as modelled", label(&node)));
        }
        let mut primitives = node.mesh().into_iter().flat_map(|mesh| mesh.primitives());
        if primitives.any(|primitive| !has_triangles(&primitive)) {
            warnings.insert(format!("{}: points and lines left out, only triangles are lit", label(&node)));
        }
    }
}

/// The corners of those triangles that have an area, each triangle once.
fn whole_triangles(geometry: &Geometry) -> impl Iterator<Item = [DVec3; 3]> {
    let mut seen = HashSet::new();
    geometry.triangles.iter().map(|corners| corners.map(|corner| geometry.positions[corner])).filter(
        move |corners| {
            let [a, b, c] = *corners;
            let longest = [b - a, c - b, a - c].map(DVec3::length_squared).into_iter().fold(0.0, f64::max);
            let has_area = (b - a).cross(c - a).length() > LEAST_HEIGHT * longest;
            // The same three corners in the same turn, from whichever they start; adding zero makes a negative zero positive.
            let bits = corners.map(|corner| (corner + DVec3::ZERO).to_array().map(f64::to_bits));
            let turns = [bits, [bits[1], bits[2], bits[0]], [bits[2], bits[0], bits[1]]];
            has_area && turns.into_iter().min().is_some_and(|turn| seen.insert(turn))
        },
    )
}

/// Whether the file's normals deviate from those of the triangles, in the node's coordinates.
fn is_smooth(positions: &[DVec3], normals: &[DVec3], triangles: &[[usize; 3]]) -> bool {
    triangles.iter().any(|triangle| {
        let [a, b, c] = triangle.map(|corner| positions[corner]);
        let flat = (b - a).cross(c - a).normalize_or_zero();
        let deviates = |corner: usize| {
            // Mirrored nodes have their triangles turned round, not their normals.
            let cosine = normals.get(corner).map_or(1.0, |normal| normal.normalize_or_zero().dot(flat).abs());
            cosine > 0.1 && cosine < SMOOTH_COSINE
        };
        triangle.iter().any(|&corner| deviates(corner))
    })
}
