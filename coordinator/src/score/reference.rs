//! References: radiosities at random points of a scene's surfaces, as CSV.

use std::fs;
use std::path::Path;

use glam::DVec3;

use super::ScoreError;

const HEADER: &str =
    "x,y,z,nx,ny,nz,primitive,radiosity_r,radiosity_g,radiosity_b,stderr_r,stderr_g,stderr_b";

/// A point of a reference.
pub(super) struct ReferencePoint {
    /// Position in the world.
    pub(super) position: DVec3,
    /// Unit normal.
    pub(super) normal: DVec3,
    /// Number of the primitive, in the order in which a walk of the scene's nodes meets them.
    pub(super) primitive: usize,
    /// Radiosity, W/m^2.
    pub(super) radiosity: DVec3,
    /// Standard error of the radiosity.
    pub(super) standard_error: DVec3,
}

/// Reads a reference.
pub(super) fn read(path: &Path) -> Result<Vec<ReferencePoint>, ScoreError> {
    let text =
        fs::read_to_string(path).map_err(|source| ScoreError::Read { path: path.to_owned(), source })?;
    let mut lines = text.lines().enumerate();
    if lines.next().map(|(_, header)| header.trim_end()) != Some(HEADER) {
        return Err(ScoreError::Header { path: path.to_owned(), expected: HEADER });
    }
    let points = lines
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(index, line)| {
            parse(line).ok_or_else(|| ScoreError::Line { path: path.to_owned(), line: index + 1 })
        })
        .collect::<Result<Vec<_>, _>>()?;
    if points.is_empty() {
        return Err(ScoreError::NoPoints(path.to_owned()));
    }
    Ok(points)
}

fn parse(line: &str) -> Option<ReferencePoint> {
    let numbers: Vec<f64> =
        line.split(',').map(|field| field.trim().parse().ok()).collect::<Option<Vec<f64>>>()?;
    let (numbers, []) = numbers.as_chunks::<13>() else { return None };
    let [numbers] = numbers else { return None };
    let primitive = numbers[6];
    let valid =
        numbers.iter().all(|number| number.is_finite()) && primitive >= 0.0 && primitive.fract() == 0.0;
    let vector = |start: usize| DVec3::from_slice(&numbers[start..]);
    valid.then(|| ReferencePoint {
        position: vector(0),
        normal: vector(3),
        primitive: primitive as usize,
        radiosity: vector(7),
        standard_error: vector(10),
    })
}
