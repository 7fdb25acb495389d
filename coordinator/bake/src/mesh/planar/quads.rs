use std::cmp::Reverse;

use glam::DVec2;
use smallvec::SmallVec;

use super::triangles::Triangles;

/// Least sine of a quadrilateral's angles.
const LEAST_SINE: f64 = 0.4;

/// Steps in which sines are compared, so that rounding decides nothing.
const STEPS: f64 = 1024.0;

/// A triangle, or two of them.
pub struct Polygon {
    /// Index of its facet within the surface.
    pub facet: u32,
    /// Indices of vertices, counter-clockwise.
    pub corners: SmallVec<[u32; 4]>,
    /// Whether one of its edges is a border or a line.
    pub is_at_border: bool,
}

/// Joins triangles in pairs, the best quadrilaterals first: they divide into better patches, and into fewer.
pub fn paired(all: &Triangles) -> Vec<Polygon> {
    let mut pairs = vec![];
    for (index, triangle) in (0..).zip(&all.triangles) {
        for (edge, other) in triangle.beside.iter().enumerate() {
            if let Some(other) = other.filter(|other| *other > index)
                && all.triangles[other as usize].facet == triangle.facet
                && let Some(corners) = union(all, index, other, edge)
            {
                let sine = least_sine(all, &corners);
                if sine >= LEAST_SINE {
                    pairs.push((Reverse((sine * STEPS) as u32), index, other, corners));
                }
            }
        }
    }
    pairs.sort_unstable();
    let mut partner: Vec<Option<([u32; 4], u32)>> = vec![None; all.triangles.len()];
    for (_, a, b, corners) in pairs {
        if partner[a as usize].is_none() && partner[b as usize].is_none() {
            partner[a as usize] = Some((corners, b));
            partner[b as usize] = Some((corners, a));
        }
    }
    let mut polygons = vec![];
    for (index, triangle) in (0..).zip(&all.triangles) {
        let at_border = |index: u32| all.triangles[index as usize].beside.contains(&None);
        match partner[index as usize] {
            Some((_, other)) if other < index => {}
            Some((corners, other)) => polygons.push(Polygon {
                facet: triangle.facet,
                corners: SmallVec::from(corners),
                is_at_border: at_border(index) || at_border(other),
            }),
            None => polygons.push(Polygon {
                facet: triangle.facet,
                corners: SmallVec::from_slice(&triangle.corners),
                is_at_border: at_border(index),
            }),
        }
    }
    polygons
}

/// The quadrilateral of a triangle and the one beyond one of its edges.
fn union(all: &Triangles, index: u32, other: u32, edge: usize) -> Option<[u32; 4]> {
    let corners = all.triangles[index as usize].corners;
    let apex = all.triangles[other as usize].corners.into_iter().find(|corner| !corners.contains(corner))?;
    Some([corners[edge], apex, corners[(edge + 1) % 3], corners[(edge + 2) % 3]])
}

/// Least sine of the angles; negative where one is over 180 degrees.
fn least_sine(all: &Triangles, corners: &[u32; 4]) -> f64 {
    let at = |i: usize| -> DVec2 { all.vertices[corners[i % 4] as usize].0 };
    let sine = |i: usize| {
        let (before, after) = (at(i) - at(i + 3), at(i + 1) - at(i));
        before.normalize_or_zero().perp_dot(after.normalize_or_zero())
    };
    (0..4).map(sine).fold(f64::INFINITY, f64::min)
}
