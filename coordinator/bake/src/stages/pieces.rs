//! Transparent occluders, cut into pieces of even opacity.
//!
//! Texture lookups per ray would need the textures on every worker, and rows would no longer be exact. So holes become
//! geometry: a facet is halved until a piece is opaque, open, or small; mixed pieces then take their mean opacity.

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, Corners, split};
use kernel::replica::ScenePolygons;

use scene::Surface;

/// Most halvings of a facet: 256 pieces, an outline finer than a twentieth of its size.
const MOST_HALVINGS: u32 = 8;

/// Pieces that all facets together may be cut into by halving, each as many as its part of their area: leaves and decals by the thousand
/// are more than rays can be asked to pass.
const MOST_PIECES: f64 = 100_000.0;

/// How often a facet of this part of the area of all transparent ones is halved at most.
pub fn halvings(part: f64) -> u32 {
    (part * MOST_PIECES).max(1.0).log2().floor().min(f64::from(MOST_HALVINGS)) as u32
}

/// Opacities closer than this are equal: a step of eight bits.
const ONE_OPACITY: f64 = 1.0 / 256.0;

/// The pieces of a facet that are not open, each with its mean opacity.
pub fn cut_by_opacity(surface: &Surface, facet: u32, halvings: u32) -> ScenePolygons {
    let source = &surface.facets[facet as usize];
    let corners: Corners = source.positions().collect();
    let mut pieces = ScenePolygons::default();
    let mut waiting = vec![(corners, halvings)];
    while let Some((corners, halvings)) = waiting.pop() {
        let opacity = surface.mean_opacity(facet, &corners);
        if opacity <= 0.0 {
            continue;
        }
        if halvings > 0 && opacity < 1.0 && surface.appearance.is_some() {
            let halves = halved(&corners);
            let is_even = halves
                .iter()
                .flat_map(|half| halved(half))
                .filter(|part| part.len() >= 3)
                .all(|part| (surface.mean_opacity(facet, &part) - opacity).abs() <= ONE_OPACITY);
            if !is_even {
                waiting.extend(
                    halves.into_iter().filter(|half| half.len() >= 3).map(|half| (half, halvings - 1)),
                );
                continue;
            }
        }
        pieces.polygons.push(ConvexPolygon { plane: source.plane, corners: corners.to_vec() });
        pieces.opacities.push(opacity.min(1.0) as f32);
    }
    pieces
}

/// Both halves of a convex polygon, cut across its longest side.
fn halved(corners: &[DVec3]) -> [Corners; 2] {
    let next = corners.iter().cycle().skip(1);
    let along = corners.iter().zip(next).map(|(a, b)| *b - *a).fold(DVec3::ZERO, |longest, side| {
        if side.length_squared() > longest.length_squared() { side } else { longest }
    });
    let along = along.normalize_or_zero();
    let places = || corners.iter().map(|corner| along.dot(*corner));
    let middle = (places().fold(f64::MAX, f64::min) + places().fold(f64::MIN, f64::max)) / 2.0;
    let heights: Vec<f64> = places().map(|place| place - middle).collect();
    let (mut above, mut below) = (Corners::new(), Corners::new());
    split(corners, &heights, &mut above, &mut below);
    [above, below]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_facets_share_the_pieces() {
        assert_eq!(halvings(1.0), MOST_HALVINGS);
        assert_eq!(halvings(0.001), 6);
        assert_eq!(halvings(1e-6), 0);
        // Whatever their number, as many pieces in all at the most.
        for count in [10_u32, 1000, 30_000] {
            let part = f64::from(count).recip();
            assert!(f64::from(count) * f64::from(1 << halvings(part)) <= MOST_PIECES);
        }
    }
}
