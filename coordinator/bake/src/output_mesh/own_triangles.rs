//! The input's own triangles where their corners suffice.

use std::collections::BTreeMap;

use smallvec::SmallVec;

use super::collapse::under;
use super::linear::LightIn;
use super::working::{NONE, Triangle, Working};
use scene::Scene;

/// Gives facets back the input's triangles where these have the same corners, and show the light as well.
pub fn restore(working: &mut Working, scene: &Scene) {
    let mut of_facet: BTreeMap<(u32, u32), Vec<u32>> = BTreeMap::new();
    for (index, triangle) in working.alive() {
        of_facet.entry((triangle.surface, triangle.facet)).or_default().push(index);
    }
    for ((surface, facet), triangles) in of_facet {
        let facet_of_input = &scene.surfaces[surface as usize].facets[facet as usize];
        if facet_of_input.triangles.len() != triangles.len() {
            continue;
        }
        let mut corners: SmallVec<[u32; 12]> =
            triangles.iter().flat_map(|index| working.triangles[*index as usize].corners).collect();
        corners.sort_unstable();
        corners.dedup();
        let find = |position| corners.iter().copied().find(|corner| working.at(*corner) == position);
        let own: Option<Vec<[u32; 3]>> = facet_of_input
            .triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.positions.map(find);
                Some([a?, b?, c?])
            })
            .collect();
        // A convex facet's triangles and others of its corners cover the same, if their areas are equal.
        let uses = |corner: &u32| own.iter().flatten().any(|triangle| triangle.contains(corner));
        if corners.iter().all(uses)
            && let Some(own) = own
        {
            working.exchange(&triangles, own);
        }
    }
}

impl Working {
    /// Exchanges the triangles of a facet for others over the same corners, where the light allows it.
    fn exchange(&mut self, old: &[u32], new: Vec<[u32; 3]>) -> Option<()> {
        let region = self.triangles[old[0] as usize].region;
        let area = |all: &mut dyn Iterator<Item = [u32; 3]>| -> Option<f64> {
            all.map(|corners| self.shape(region, corners).map(|shape| shape.0)).sum()
        };
        let before = area(&mut old.iter().map(|index| self.triangles[*index as usize].corners))?;
        let after = area(&mut new.iter().copied())?;
        if (before - after).abs() > 1e-6 * before {
            return None;
        }
        let lights: Vec<LightIn> = new.iter().map(|corners| self.light_between(region, *corners)).collect();
        for index in old {
            let Triangle { samples, region: own, .. } = &self.triangles[*index as usize];
            if *own != region {
                return None;
            }
            for sample in samples {
                let sample = &self.samples[*sample as usize];
                let (_, light, weights) = under(lights.iter().copied(), sample.position)?;
                if light.deviation(weights, sample).length_squared() > sample.limit {
                    return None;
                }
            }
        }
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
        Some(())
    }
}
