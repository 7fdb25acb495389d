//! The error of a lit scene against a path-traced reference.
//!
//! At every point of the reference the lit scene's `_IRRADIANCE` is interpolated linearly over the triangle under it and
//! multiplied by the surface's reflectance, which the input scene has. That gives a radiosity to compare with the
//! reference's. Reading, point location and arithmetic share nothing with the solver, so that a mistake of it cannot hide
//! here.

mod lit_glb;
mod locate;
mod reference;
#[cfg(test)]
mod tests;

use std::io;
use std::path::{Path, PathBuf};

use glam::DVec3;

use self::locate::TriangleGrid;
use self::reference::ReferencePoint;

/// Weights of linear RGB in luminance, after Rec. 709.
const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// How far a lit scene is from its reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// Relative L2 norm of the error of the radiosity, sqrt(int (B' - B)^2 / int B^2), over points and channels, with the
    /// variance of the reference itself taken out of both integrals. NaN when a radiosity is.
    pub relative_l2: f64,
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

/// Why there is no score.
#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    /// A file cannot be read.
    #[error("{path} cannot be read: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
    /// A scene is no valid glTF.
    #[error("{path} is not a valid glTF: {source}")]
    Gltf {
        /// The file.
        path: PathBuf,
        /// What the glTF reader says.
        source: gltf::Error,
    },
    /// A scene's data lie outside the file, or do not have the type that they should.
    #[error(
        "{path}: {what} of {node} cannot be read: it must be in the GLB's own buffer, as float VEC3 or as indices of existing vertices"
    )]
    Data {
        /// The file.
        path: PathBuf,
        /// The node that shows the mesh.
        node: String,
        /// The attribute's name, or indices.
        what: &'static str,
    },
    /// A lit scene that was not lit, or not everywhere.
    #[error("{path}: a primitive of {node} has no _IRRADIANCE: bake the scene first")]
    NotLit {
        /// The file.
        path: PathBuf,
        /// The node that shows the mesh.
        node: String,
    },
    /// The reference's first line is not the one that this format has.
    #[error("{path} is not a reference: its first line must be {expected}")]
    Header {
        /// The file.
        path: PathBuf,
        /// The right one.
        expected: &'static str,
    },
    /// A line of the reference is not what the header says.
    #[error("{path}, line {line}: expected 13 finite numbers, the seventh a primitive's index")]
    Line {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
    },
    /// The reference has a header only.
    #[error("{0} has no points")]
    NoPoints(PathBuf),
    /// The reference was made of another scene.
    #[error(
        "{reference} refers to primitive {primitive}, but {scene} has {count}: use the scene that it was made of"
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
    /// The lit scene and the reference have no place in common.
    #[error(
        "no point of {0} lies on the lit scene: was it baked from the scene that the reference was made of?"
    )]
    NothingCovered(PathBuf),
}

/// Compares a lit GLB with a reference (CSV) that was made of the GLB `scene`, which knows the reflectances.
///
/// # Errors
/// When a file cannot be read or is not what it should be; when the reference does not fit the scenes.
pub fn score(lit: &Path, reference: &Path, scene: &Path) -> Result<Score, ScoreError> {
    let points = reference::read(reference)?;
    let reflectances = lit_glb::read_reflectances(scene)?;
    if let Some(point) = points.iter().find(|point| point.primitive >= reflectances.len()) {
        return Err(ScoreError::Primitive {
            reference: reference.to_owned(),
            scene: scene.to_owned(),
            primitive: point.primitive,
            count: reflectances.len(),
        });
    }
    let mesh = lit_glb::read(lit)?;
    let corners = |pick: fn(DVec3, DVec3) -> DVec3, start| {
        points.iter().fold(start, |bound, point| pick(bound, point.position))
    };
    let extent = corners(DVec3::max, DVec3::MIN) - corners(DVec3::min, DVec3::MAX);
    let grid = TriangleGrid::new(&mesh.triangles, extent.max_element());
    let radiosities: Vec<Option<DVec3>> = points
        .iter()
        .map(|point| {
            let (triangle, weights) = grid.locate(point.position, point.normal)?;
            let [a, b, c] = mesh.irradiances[triangle];
            Some(reflectances[point.primitive] * (weights.x * a + weights.y * b + weights.z * c))
        })
        .collect();
    let score =
        compare(&points, &radiosities).ok_or_else(|| ScoreError::NothingCovered(reference.to_owned()))?;
    Ok(Score { vertices: mesh.vertices, triangles: mesh.triangles.len(), ..score })
}

/// The figures, without those of the mesh; `None` when no point has a radiosity.
fn compare(points: &[ReferencePoint], radiosities: &[Option<DVec3>]) -> Option<Score> {
    let covered: Vec<(&ReferencePoint, DVec3)> = points
        .iter()
        .zip(radiosities)
        .filter_map(|(point, radiosity)| Some((point, (*radiosity)?)))
        .collect();
    if covered.is_empty() {
        return None;
    }
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
    Some(Score {
        relative_l2: (error / signal).sqrt(),
        energy_ratio: sum(|_, b| b).element_sum() / sum(|point, _| point.radiosity).element_sum(),
        p95: quantile(&deviations, 0.95),
        max: deviations[deviations.len() - 1],
        uncovered: points.len() - covered.len(),
        not_finite: covered.iter().filter(|(_, b)| !b.is_finite()).count(),
        vertices: 0,
        triangles: 0,
    })
}

/// Quantile of sorted values, interpolated linearly between the two nearest.
fn quantile(sorted: &[f64], fraction: f64) -> f64 {
    let place = fraction * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    below + (above - below) * place.fract()
}
