//! The error of a lit scene against a path-traced reference.
//!
//! At every point of the reference the lit scene's `_IRRADIANCE` is interpolated linearly over the triangle under it and
//! multiplied by the surface's reflectance; what the surface emits itself is added. The input scene has both. That gives a
//! radiosity to compare with the reference's. Reading, point location and arithmetic share nothing with the solver, so that
//! a mistake of it cannot hide here.

mod lit_glb;
mod locate;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use document::ReadOptions;
use glam::DVec3;
use kernel::geometry::Bounds;

use self::locate::TriangleGrid;
use crate::plain::{PlainError, PlainOptions, PlainScene};
use crate::reference::{
    Place, ReferenceFileError, ReferencePoint, locate, materials, read, relative_standard_error,
};

/// Weights of linear RGB in luminance, after Rec. 709.
const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// A reference of more noise than this tells little, whatever error is found.
const MOST_NOISE: f64 = 0.5;

/// How far a lit scene is from its reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// Relative L2 norm of the error of the radiosity, sqrt(int (B' - B)^2 / int B^2), over points and channels, with the
    /// variance of the reference itself taken out of both integrals. NaN when a radiosity is.
    pub relative_l2: f64,
    /// Standard error of the reference's radiosity, relative to its norm: an error below it is hardly known.
    pub reference_noise: f64,
    /// Sum of the radiosity over the reference's: 1 is without bias.
    pub energy_ratio: f64,
    /// 95th percentile of |B' - B| / mean B, in luminance.
    pub p95: f64,
    /// Largest |B' - B| / mean B, in luminance.
    pub max: f64,
    /// Points of the reference under which there is no triangle; the other figures leave them out.
    pub uncovered: usize,
    /// Points whose irradiance is NaN or infinite.
    pub not_finite: usize,
    /// Vertices of the lit scene.
    pub vertices: usize,
    /// Triangles of the lit scene.
    pub triangles: usize,
}

impl Score {
    /// Whether the noise of the reference is more than the error found, or so much that the reference tells little.
    #[must_use]
    pub fn is_lost_in_noise(&self) -> bool {
        self.reference_noise > self.relative_l2.min(MOST_NOISE)
    }
}

/// Why there is no score.
#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    /// A scene cannot be read.
    #[error(transparent)]
    Scene(#[from] PlainError),
    /// The reference cannot be read.
    #[error(transparent)]
    Reference(#[from] ReferenceFileError),
    /// A lit scene that was not lit, or not everywhere.
    #[error("{path}: a primitive of {node} has no _IRRADIANCE: bake the scene first")]
    NotLit {
        /// The file.
        path: PathBuf,
        /// The node that shows the mesh.
        node: String,
    },
    /// The reference belongs to another scene.
    #[error(
        "{reference} refers to primitive {primitive}, but {scene} has {count}: use the scene of the reference"
    )]
    Primitive {
        /// The reference.
        reference: PathBuf,
        /// The scene.
        scene: PathBuf,
        /// The index in the reference.
        primitive: usize,
        /// Primitives of the scene.
        count: usize,
    },
    /// The reference has points where the scene has no surface.
    #[error(
        "{off} of {points} points of {reference} lie on no surface of {scene}, the first on line {line}: use the scene of the reference"
    )]
    OffScene {
        /// The reference.
        reference: PathBuf,
        /// The scene.
        scene: PathBuf,
        /// Points on no surface of the primitive that they name.
        off: usize,
        /// Points of the reference.
        points: usize,
        /// Line of the first of them, where no line is empty.
        line: usize,
    },
    /// The lit scene and the reference have hardly a place in common.
    #[error(
        "{covered} of {points} points of {reference} lie on the lit scene {lit}: bake the scene of the reference"
    )]
    NotCovered {
        /// The reference.
        reference: PathBuf,
        /// The lit scene.
        lit: PathBuf,
        /// Points on a triangle of the lit scene.
        covered: usize,
        /// Points of the reference.
        points: usize,
    },
}

/// Part of a reference's points that may lie beside the scene, by rounding at its edges. In another scene, even one in which a
/// single thing stands elsewhere, it is more.
const MOST_OFF_SCENE: f64 = 0.01;

/// Part of a reference's points that must lie on the lit scene.
const LEAST_COVERED: f64 = 0.5;

/// Compares a lit GLB with a reference (CSV) of the scene that it was, which has the reflectances and is read with these options.
///
/// # Errors
/// When a file cannot be read or is malformed; when the reference does not fit the scenes.
pub fn score(lit: &Path, reference: &Path, scene: &Path, options: &ReadOptions) -> Result<Score, ScoreError> {
    score_points(lit, reference, scene, options).map(|(score, _)| score)
}

/// As [`score`], with what the lit scene has at the points of the reference, as if it were a reference itself; points under which
/// it has no triangle are left out.
///
/// # Errors
/// As for [`score`].
pub fn score_points(
    lit: &Path,
    reference: &Path,
    scene: &Path,
    options: &ReadOptions,
) -> Result<(Score, Vec<ReferencePoint>), ScoreError> {
    let points = read(reference)?;
    let source = open(scene, options)?;
    check_fit(&points, &source, reference, scene)?;
    let mesh = lit_glb::read(lit)?;
    let extent = Bounds::around(mesh.triangles.as_flattened()).extent();
    let grid = TriangleGrid::new(&mesh.triangles, extent.max_element());
    let places: Vec<Place> = points.iter().map(|point| point.place).collect();
    let radiosities: Vec<Option<DVec3>> = points
        .iter()
        .zip(materials(&source, &places))
        .map(|(point, material)| {
            let (triangle, weights) = grid.locate(point.place.position, point.place.normal)?;
            let [a, b, c] = mesh.irradiances[triangle];
            let irradiance = weights.x * a + weights.y * b + weights.z * c;
            Some((material.exitance + material.reflectance * irradiance) * material.opacity)
        })
        .collect();
    let covered = radiosities.iter().flatten().count();
    if (covered as f64) < LEAST_COVERED * points.len() as f64 {
        let (reference, lit) = (reference.to_owned(), lit.to_owned());
        return Err(ScoreError::NotCovered { reference, lit, covered, points: points.len() });
    }
    let score = compare(&points, &radiosities);
    let lit_point = |(point, radiosity): (&ReferencePoint, &Option<DVec3>)| {
        radiosity.map(|radiosity| ReferencePoint {
            place: point.place,
            radiosity,
            standard_error: DVec3::ZERO,
        })
    };
    let lit_points = points.iter().zip(&radiosities).filter_map(lit_point).collect();
    Ok((Score { vertices: mesh.vertices, triangles: mesh.triangles.len(), ..score }, lit_points))
}

/// Checks that a reference (CSV) belongs to a scene, as [`score`] does, before there is a lit scene.
///
/// # Errors
/// When a file cannot be read or is malformed; when the reference does not fit the scene.
pub fn check_reference(reference: &Path, scene: &Path, options: &ReadOptions) -> Result<(), ScoreError> {
    check_fit(&read(reference)?, &open(scene, options)?, reference, scene)
}

fn open(scene: &Path, options: &ReadOptions) -> Result<PlainScene, PlainError> {
    PlainScene::open_with(scene, &PlainOptions { read: options.clone(), ..PlainOptions::default() })
}

/// Checks that the points lie on the scene.
fn check_fit(
    points: &[ReferencePoint],
    source: &PlainScene,
    reference: &Path,
    scene: &Path,
) -> Result<(), ScoreError> {
    let (reference, scene) = (reference.to_owned(), scene.to_owned());
    let count = source.materials.len();
    if let Some(point) = points.iter().find(|point| point.place.primitive >= count) {
        return Err(ScoreError::Primitive { reference, scene, primitive: point.place.primitive, count });
    }
    let places: Vec<Place> = points.iter().map(|point| point.place).collect();
    let located = locate(source, &places);
    let off = located.iter().filter(|place| place.is_none()).count();
    match located.iter().position(Option::is_none) {
        Some(first) if off as f64 > MOST_OFF_SCENE * points.len() as f64 => {
            // The header is line 1.
            Err(ScoreError::OffScene { reference, scene, off, points: points.len(), line: first + 2 })
        }
        _ => Ok(()),
    }
}

/// The figures, without those of the mesh; at least one point has a radiosity.
fn compare(points: &[ReferencePoint], radiosities: &[Option<DVec3>]) -> Score {
    let covered: Vec<(&ReferencePoint, DVec3)> = points
        .iter()
        .zip(radiosities)
        .filter_map(|(point, radiosity)| Some((point, (*radiosity)?)))
        .collect();
    let sum = |of: fn(&ReferencePoint, DVec3) -> DVec3| {
        covered.iter().map(|&(point, b)| of(point, b)).sum::<DVec3>()
    };
    let variance = sum(|point, _| point.standard_error * point.standard_error).element_sum();
    let signal = sum(|point, _| point.radiosity * point.radiosity).element_sum() - variance;
    let error = sum(|point, b| (b - point.radiosity) * (b - point.radiosity)).element_sum() - variance;
    // Not f64::max, which would turn NaN into 0.
    let error = if error < 0.0 { 0.0 } else { error };
    let mean_luminance = sum(|point, _| point.radiosity).dot(LUMINANCE) / covered.len() as f64;
    let mut deviations: Vec<f64> = covered
        .iter()
        .map(|(point, b)| (*b - point.radiosity).dot(LUMINANCE).abs() / mean_luminance)
        .collect();
    // NaN comes last, so that it shows in the maximum.
    deviations.sort_by(f64::total_cmp);
    Score {
        relative_l2: (error / signal).sqrt(),
        reference_noise: relative_standard_error(covered.iter().map(|(point, _)| *point)),
        energy_ratio: sum(|_, b| b).element_sum() / sum(|point, _| point.radiosity).element_sum(),
        p95: quantile(&deviations, 0.95),
        max: deviations[deviations.len() - 1],
        uncovered: points.len() - covered.len(),
        not_finite: covered.iter().filter(|(_, b)| !b.is_finite()).count(),
        vertices: 0,
        triangles: 0,
    }
}

/// Quantile of sorted values, interpolated linearly between the two nearest.
fn quantile(sorted: &[f64], fraction: f64) -> f64 {
    let place = fraction * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    below + (above - below) * place.fract()
}
