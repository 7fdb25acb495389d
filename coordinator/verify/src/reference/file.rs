//! References as CSV: one line per point.

use std::fmt::Write;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::{Place, ReferencePoint};

const HEADER: &str =
    "x,y,z,nx,ny,nz,primitive,radiosity_r,radiosity_g,radiosity_b,stderr_r,stderr_g,stderr_b";

/// Digits after the first that positions have, relative to the largest coordinate: as many as an f32 holds.
const POSITION_DIGITS: i32 = 7;

/// Digits after the first of radiosities and standard errors.
const LIGHT_DIGITS: i32 = 5;

/// Why a file is no reference.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceFileError {
    /// The file cannot be read.
    #[error("{path} cannot be read: {error}; check the path and the permissions")]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        error: io::Error,
    },
    /// The first line is not the one that this format has.
    #[error("{path} is not a reference: its first line must be {expected}")]
    Header {
        /// The file.
        path: PathBuf,
        /// The right one.
        expected: &'static str,
    },
    /// A line is not what the header says.
    #[error("{path}, line {line}: expected 13 finite numbers, the seventh a primitive's index")]
    Line {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
    },
    /// There is a header only.
    #[error("{0} has no points")]
    NoPoints(PathBuf),
}

/// Reads a reference.
///
/// # Errors
/// When the file cannot be read, is not a reference or has no points.
pub fn read(path: &Path) -> Result<Vec<ReferencePoint>, ReferenceFileError> {
    let text = fs::read_to_string(path)
        .map_err(|error| ReferenceFileError::Read { path: path.to_owned(), error })?;
    let mut lines = text.lines().enumerate();
    if lines.next().map(|(_, header)| header.trim_end()) != Some(HEADER) {
        return Err(ReferenceFileError::Header { path: path.to_owned(), expected: HEADER });
    }
    let points = lines
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(index, line)| {
            parse(line).ok_or_else(|| ReferenceFileError::Line { path: path.to_owned(), line: index + 1 })
        })
        .collect::<Result<Vec<_>, _>>()?;
    if points.is_empty() {
        return Err(ReferenceFileError::NoPoints(path.to_owned()));
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
        place: Place { position: vector(0), normal: vector(3), primitive: primitive as usize },
        radiosity: vector(7),
        standard_error: vector(10),
    })
}

/// The file's text.
#[must_use]
pub fn to_csv(points: &[ReferencePoint]) -> String {
    let largest = points.iter().map(|point| point.place.position.abs().max_element()).fold(0.0, f64::max);
    let last_place = place_value(largest) - POSITION_DIGITS;
    let mut text = format!("{HEADER}\n");
    for point in points {
        let place = &point.place;
        let fields = place.position.to_array().map(|value| decimal(value, last_place)).into_iter();
        let fields = fields
            .chain(place.normal.to_array().map(|value| decimal(value, -9)))
            .chain([place.primitive.to_string()])
            .chain([point.radiosity, point.standard_error].into_iter().flat_map(|rgb| {
                rgb.to_array().map(|value| decimal(value, place_value(value) - LIGHT_DIGITS))
            }));
        let line: Vec<String> = fields.collect();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", line.join(","));
    }
    text
}

/// Power of ten of the first digit; that of 1 for 0.
fn place_value(value: f64) -> i32 {
    if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 }
}

/// The value rounded to this power of ten, without zeros at the end.
fn decimal(value: f64, last_place: i32) -> String {
    let digits = (place_value(value) - last_place).max(0) as usize;
    let rounded: f64 = format!("{value:.digits$e}").parse().unwrap_or(value);
    // Adding zero makes a negative zero positive.
    let rounded = if rounded.abs() < 0.5 * 10f64.powi(last_place) { 0.0 } else { rounded + 0.0 };
    if rounded != 0.0 && !(1e-9..1e15).contains(&rounded.abs()) {
        format!("{rounded:e}")
    } else {
        rounded.to_string()
    }
}
