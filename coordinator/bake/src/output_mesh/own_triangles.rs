//! The input's own triangles where their corners suffice.

use rayon::prelude::*;
use smallvec::SmallVec;

use super::collapse::under;
use super::linear::LightIn;
use super::working::{NONE, Triangle, Working};
use scene::{Facet, Scene, SourceTriangle};

/// Gives facets back the input's triangles where these have the same corners, and show the light as well.
pub fn restore(working: &mut Working, scene: &Scene) {
    let place = |(index, triangle): (u32, &Triangle)| (triangle.surface, triangle.facet, index);
    let mut of_facets: Vec<(u32, u32, u32)> = working.alive().map(place).collect();
    of_facets.par_sort_unstable();
    let of_facets: Vec<_> = of_facets.chunk_by(|one, other| (one.0, one.1) == (other.0, other.1)).collect();
    let restored = |own: &&[(u32, u32, u32)]| {
        let (surface, facet, _) = own[0];
        let old: SmallVec<[u32; 2]> = own.iter().map(|(_, _, index)| *index).collect();
        let facet = &scene.surfaces[surface as usize].facets[facet as usize];
        let new = working.own_triangles(facet, &old).filter(|new| working.may_exchange(&old, new))?;
        Some((old, new))
    };
    let restored: Vec<_> = of_facets.par_iter().with_min_len(64).filter_map(restored).collect();
    restored.into_iter().for_each(|(old, new)| working.exchange(&old, new));
}

/// Corners of some triangles.
type Corners = SmallVec<[[u32; 3]; 2]>;

impl Working {
    /// The input's triangles of a facet, if they have the corners of those that it has now.
    fn own_triangles(&self, facet: &Facet, old: &[u32]) -> Option<Corners> {
        if facet.triangles.len() != old.len() {
            return None;
        }
        let mut corners: SmallVec<[u32; 12]> =
            old.iter().flat_map(|index| self.triangles[*index as usize].corners).collect();
        corners.sort_unstable();
        corners.dedup();
        let find = |position| corners.iter().copied().find(|corner| self.at(*corner) == position);
        let of_corners = |triangle: &SourceTriangle| {
            let [a, b, c] = triangle.positions.map(find);
            Some([a?, b?, c?])
        };
        let own: Corners = facet.triangles.iter().map(of_corners).collect::<Option<_>>()?;
        // A convex facet's triangles and others of its corners cover the same, if their areas are equal.
        let uses = |corner: &u32| own.iter().any(|triangle| triangle.contains(corner));
        corners.iter().all(uses).then_some(own)
    }

    /// Whether the light allows others in place of the triangles of a facet, over the same corners.
    fn may_exchange(&self, old: &[u32], new: &[[u32; 3]]) -> bool {
        let region = self.triangles[old[0] as usize].region;
        let area = |all: &mut dyn Iterator<Item = [u32; 3]>| -> Option<f64> {
            all.map(|corners| self.shape(region, corners).map(|shape| shape.0)).sum()
        };
        let before = area(&mut old.iter().map(|index| self.triangles[*index as usize].corners));
        let after = area(&mut new.iter().copied());
        let is_whole =
            before.zip(after).is_some_and(|(before, after)| (before - after).abs() <= 1e-6 * before);
        if !is_whole {
            return false;
        }
        let lights: SmallVec<[LightIn; 2]> =
            new.iter().map(|corners| self.light_between(region, *corners)).collect();
        let is_shown = |sample: &u32| {
            let sample = &self.samples[*sample as usize];
            under(lights.iter().copied(), sample.position).is_some_and(|(_, light, weights)| {
                light.deviation(weights, sample).length_squared() <= sample.limit
            })
        };
        old.iter()
            .map(|index| &self.triangles[*index as usize])
            .all(|triangle| triangle.region == region && triangle.samples.iter().all(is_shown))
    }

    /// Exchanges the triangles of a facet for others over the same corners.
    fn exchange(&mut self, old: &[u32], new: Corners) {
        let mut samples = vec![];
        for (index, corners) in old.iter().zip(new) {
            let triangle = &mut self.triangles[*index as usize];
            samples.append(&mut triangle.samples);
            for corner in std::mem::replace(&mut triangle.corners, corners) {
                if corner != NONE {
                    self.corners[corner as usize].around.retain(|around| around != index);
                }
            }
            for corner in corners {
                self.corners[corner as usize].around.push(*index);
            }
        }
        self.deal_out(samples, old);
    }
}
