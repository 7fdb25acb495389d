//! The lit triangles of a scene that was baked.

use std::path::Path;

use glam::DVec3;
use gltf::Semantic;

use document::ReadOptions;

use super::ScoreError;
use crate::plain::PlainError;
use crate::plain::source::{Geometry, PlainDocument, label};

/// Area of a primitive that may be without light, relative to the square of the scene's extent.
const LEAST_AREA: f64 = 1e-12;

/// The triangles of a lit scene, in the world.
#[derive(Default)]
pub(super) struct LitTriangles {
    /// Corners, counter-clockwise seen from the front.
    pub(super) triangles: Vec<[DVec3; 3]>,
    /// Irradiance at the corners.
    pub(super) irradiances: Vec<[DVec3; 3]>,
    /// Vertices of all primitives.
    pub(super) vertices: usize,
}

/// Reads the triangles of a lit scene.
pub(super) fn read(path: &Path) -> Result<LitTriangles, ScoreError> {
    let document = PlainDocument::open(path, &ReadOptions::default())?;
    let mut lit = LitTriangles::default();
    let mut unlit = vec![];
    for (node, primitive) in document.primitives() {
        let accessor = primitive.get(&Semantic::Extras("IRRADIANCE".into()));
        if accessor.is_none() {
            unlit.push((label(&node), area(&document.geometry(&node, &primitive)?)));
            continue;
        }
        let irradiances = document.vectors(&node, accessor, "_IRRADIANCE")?;
        let geometry = document.geometry(&node, &primitive)?;
        if irradiances.len() != geometry.positions.len() {
            let (path, node) = (path.to_owned(), label(&node));
            return Err(PlainError::Data { path, node, what: "_IRRADIANCE" }.into());
        }
        for corners in geometry.triangles {
            lit.triangles.push(corners.map(|corner| geometry.positions[corner]));
            lit.irradiances.push(corners.map(|corner| irradiances[corner]));
        }
        lit.vertices += geometry.positions.len();
    }
    let corners = || lit.triangles.iter().flatten();
    let [low, high] =
        [DVec3::min, DVec3::max].map(|end| corners().copied().reduce(end).unwrap_or(DVec3::ZERO));
    let least = LEAST_AREA * (high - low).length_squared();
    // One that is too small to be lit has no light.
    match unlit.into_iter().find(|(_, area)| lit.triangles.is_empty() || *area > least) {
        Some((node, _)) => Err(ScoreError::NotLit { path: path.to_owned(), node }),
        None => Ok(lit),
    }
}

fn area(geometry: &Geometry) -> f64 {
    let of = |corners: &[usize; 3]| {
        let [a, b, c] = corners.map(|corner| geometry.positions[corner]);
        (b - a).cross(c - a).length() / 2.0
    };
    geometry.triangles.iter().map(of).sum()
}
