//! The lit triangles of a scene that was baked.

use std::path::Path;

use glam::DVec3;
use gltf::Semantic;

use document::ReadOptions;

use super::ScoreError;
use crate::plain::PlainError;
use crate::plain::source::{PlainDocument, label};

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
    let mut unlit = None;
    for (node, primitive) in document.primitives() {
        let accessor = primitive.get(&Semantic::Extras("IRRADIANCE".into()));
        if accessor.is_none() {
            // One that is too small to be lit has none.
            unlit.get_or_insert_with(|| label(&node));
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
    match unlit {
        Some(node) if lit.triangles.is_empty() => Err(ScoreError::NotLit { path: path.to_owned(), node }),
        _ => Ok(lit),
    }
}
