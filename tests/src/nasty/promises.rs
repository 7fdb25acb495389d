//! What must hold of every bake, whatever its scene.

use gltf::Gltf;
use gltf::accessor::{DataType, Iter};
use serde_json::Value;

use super::{Bake, End, Nasty};
use crate::programs::Signal;

/// Code of a refusal.
const REFUSED: i32 = 1;

/// Most of the emitted flux that may be missing, or too much, where a bake says that its error is met.
const IMBALANCE: f64 = 0.02;

/// Most that factors of a vertex may sum to in such a bake.
const ROW_SUM: f64 = 1.01;

/// Most memory of a bake of so many triangles, in bytes.
#[must_use]
pub fn most_bytes(triangles: usize) -> u64 {
    200_000_000 + 20_000 * triangles as u64
}

/// Most seconds of a bake of so many triangles.
#[must_use]
pub fn most_seconds(triangles: usize) -> f64 {
    10.0 * (1.0 + 20e-6 * triangles as f64)
}

/// The promises that a bake breaks, in words.
#[must_use]
pub fn broken(nasty: &Nasty, bake: &Bake) -> Vec<String> {
    let mut broken = vec![];
    if bake.said.contains("panicked") {
        broken.push("a panic".to_owned());
    }
    if bake.peak_bytes > most_bytes(nasty.triangles) {
        broken.push(format!("{} MB of memory", bake.peak_bytes / 1_000_000));
    }
    // A signal may come while a file is written under another name.
    if !bake.left.is_empty() && !matches!(bake.end, End::Signal(_)) {
        broken.push(format!("left {}", bake.left.join(", ")));
    }
    match bake.end {
        End::Code(0) => broken.extend(broken_by_result(nasty, bake)),
        End::Code(REFUSED) if nasty.is_damaged && bake.said.contains("error: ") => {}
        End::Signal(signal) if signal == Signal::TERM.as_raw() && bake.stopping_seconds.is_some() => {}
        end => broken.push(format!("ended with {end:?}")),
    }
    if bake.end != End::Code(0) {
        // Whole where the signal came after it was written.
        let is_stopped = matches!(bake.end, End::Signal(_));
        broken.extend(bake.lit.iter().filter(|_| is_stopped).flat_map(|lit| broken_by_file(lit)));
        if !is_stopped && (bake.lit.is_some() || !bake.report.is_null()) {
            broken.push("an output file without success".to_owned());
        }
    }
    broken
}

/// What a bake breaks that says that it went well.
fn broken_by_result(nasty: &Nasty, bake: &Bake) -> Vec<String> {
    let mut broken = vec![];
    let result = &bake.report["bake"];
    let of = |name: &str| -> f64 {
        result["balance"][name].as_array().into_iter().flatten().filter_map(Value::as_f64).sum()
    };
    let (emitted, imbalance) = (of("emitted"), of("imbalance"));
    let largest = result["row_sums"]["largest"].as_f64().unwrap_or(f64::NAN);
    let warnings = result["warnings"].as_array().map_or(&[][..], Vec::as_slice);
    let warns = |of: &[&str]| {
        let mut texts = warnings.iter().filter_map(Value::as_str);
        texts.any(|text| of.iter().any(|part| text.contains(part)))
    };
    let says_met = !warns(&["was asked for and", "sum to more than 1"]);
    if says_met && (imbalance.is_nan() || imbalance.abs() > IMBALANCE * emitted) {
        broken
            .push(format!("{:.2} % of the light is off, and the error is met", 100.0 * imbalance / emitted));
    }
    if says_met && (largest.is_nan() || largest > ROW_SUM) {
        broken.push(format!("rows of {largest}, and the error is met"));
    }
    let vertices = result["vertices"].as_u64().unwrap_or(u64::MAX);
    if vertices > nasty.max_vertices as u64 {
        broken.push(format!("{vertices} vertices in place of {}", nasty.max_vertices));
    }
    match &bake.lit {
        None => broken.push("success without an output file".to_owned()),
        Some(lit) => broken.extend(broken_by_file(lit)),
    }
    broken
}

/// What a lit file breaks.
fn broken_by_file(lit: &[u8]) -> Vec<String> {
    let gltf = match Gltf::from_slice(lit) {
        Ok(gltf) => gltf,
        Err(error) => return vec![format!("no glTF: {error}")],
    };
    let blob = gltf.blob.as_deref().unwrap_or_default();
    let mut broken = vec![];
    let primitives = gltf.document.meshes().flat_map(|mesh| mesh.primitives());
    for (semantic, accessor) in primitives.flat_map(|primitive| primitive.attributes()) {
        if accessor.data_type() != DataType::F32 {
            continue;
        }
        let Some(floats) = floats(&accessor, blob) else {
            broken.push(format!("{semantic:?} cannot be read"));
            continue;
        };
        let is_light = format!("{semantic:?}").contains("IRRADIANCE");
        if floats.iter().any(|value| !value.is_finite() || is_light && *value < 0.0) {
            broken.push(format!("{semantic:?} is not finite, or below zero"));
        }
    }
    broken
}

fn floats(accessor: &gltf::Accessor, blob: &[u8]) -> Option<Vec<f32>> {
    let data = |_: gltf::Buffer| Some(blob);
    Some(match accessor.dimensions().multiplicity() {
        1 => Iter::<f32>::new(accessor.clone(), data)?.collect(),
        2 => Iter::<[f32; 2]>::new(accessor.clone(), data)?.flatten().collect(),
        3 => Iter::<[f32; 3]>::new(accessor.clone(), data)?.flatten().collect(),
        _ => Iter::<[f32; 4]>::new(accessor.clone(), data)?.flatten().collect(),
    })
}
