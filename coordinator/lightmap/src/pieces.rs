//! What of each texel the triangles cover.

use glam::DVec2;
use kernel::geometry::PlaneId;
use rayon::prelude::*;

use crate::error::{LightmapError, Stop};
use crate::raster::covered;
use crate::sides::LitSide;
use crate::unwrap::Pages;

/// Part of a texel that a surface must cover for the texel to have light of its own, where one beside it has.
const LEAST_PART: f64 = 1.0 / 256.0;

/// What of a texel a triangle covers.
#[derive(Clone, Copy)]
pub struct Piece {
    /// Its number: page, row, column.
    pub texel: u32,
    pub side: u32,
    pub plane: PlaneId,
    pub triangle: u32,
    /// In texels.
    pub area: f32,
    /// On the page, in texels.
    pub middle: DVec2,
}

/// The pieces of all triangles, texel by texel: of each the surface in one plane that covers most of it.
pub fn pieces(sides: &[LitSide], pages: &Pages, stop: Stop) -> Result<Vec<Piece>, LightmapError> {
    let [width, height] = pages.size;
    let of_side = |(side_index, side): (usize, &LitSide)| {
        let layout = &pages.layouts[side_index];
        let mut pieces = vec![];
        for (index, triangle) in side.triangles.iter().enumerate() {
            let Some(page) = layout.pages[index] else { continue };
            if index % 64 == 0 && stop() {
                break;
            }
            let first = page * width * height;
            covered(layout.corners(index, pages.size), pages.size, |[x, y], area, middle| {
                let area = area as f32;
                let piece = Piece {
                    texel: first + y * width + x,
                    side: side_index as u32,
                    plane: triangle.plane,
                    triangle: index as u32,
                    area,
                    middle,
                };
                pieces.extend((area > 0.0).then_some(piece));
            });
        }
        pieces
    };
    let mut pieces: Vec<Piece> = sides.par_iter().enumerate().flat_map_iter(of_side).collect();
    if stop() {
        return Err(LightmapError::Cancelled);
    }
    pieces.par_sort_unstable_by_key(|piece| (piece.texel, piece.side, piece.plane.0, piece.triangle));
    if stop() {
        return Err(LightmapError::Cancelled);
    }
    let all: Vec<(f32, &[Piece])> = pieces.chunk_by(|a, b| a.texel == b.texel).filter_map(largest).collect();
    let is_large = |(area, _): &(f32, &[Piece])| f64::from(*area) >= LEAST_PART;
    let at = |texel: u32| all.binary_search_by_key(&texel, |(_, pieces)| pieces[0].texel).ok();
    // What covers no texel enough, such as a screw's head, takes the light of what it covers.
    let is_kept = |own: &&(f32, &[Piece])| {
        let mut others = beside(own.1[0].texel, pages.size).filter_map(at);
        is_large(own) || !others.any(|other| is_large(&all[other]))
    };
    if stop() {
        return Err(LightmapError::Cancelled);
    }
    let kept = all.par_iter().with_min_len(1024).filter(is_kept);
    Ok(kept.flat_map_iter(|(_, pieces)| pieces.iter().copied()).collect())
}

/// The pieces of the surface in one plane that covers most of a texel, and their area.
fn largest(of_texel: &[Piece]) -> Option<(f32, &[Piece])> {
    let area = |pieces: &[Piece]| pieces.iter().map(|piece| piece.area).sum::<f32>();
    let planes = of_texel.chunk_by(|a, b| (a.side, a.plane) == (b.side, b.plane));
    planes.map(|pieces| (area(pieces), pieces)).reduce(|a, b| if b.0 > a.0 { b } else { a })
}

/// Texels beside one on its page.
pub fn beside(texel: u32, [width, height]: [u32; 2]) -> impl Iterator<Item = u32> {
    let (x, y) = (texel % width, texel / width % height);
    let near = [
        (x > 0).then(|| texel - 1),
        (x + 1 < width).then(|| texel + 1),
        (y > 0).then(|| texel - width),
        (y + 1 < height).then(|| texel + width),
    ];
    near.into_iter().flatten()
}
