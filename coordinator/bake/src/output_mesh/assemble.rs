//! The lit mesh of the triangles that are left.

use foldhash::{HashMap, HashMapExt};
use glam::DVec3;
use rayon::prelude::*;

use super::fit::Fit;
use super::grid::bits;
use super::working::{Corner, NONE, Working};
use crate::lit::{LitLayer, LitMesh, LitTriangle, LitVertex};
use scene::Scene;

impl Working {
    /// The lit mesh with these triangles.
    pub fn into_lit(self, scene: &Scene, lit: LitMesh, fit: Option<&Fit>) -> LitMesh {
        let mut known: HashMap<([u32; 2], u64, [u64; 3]), u32> = HashMap::new();
        let mut surfaces = vec![vec![]; scene.surfaces.len()];
        // In the order of the vertices before: it depends on the mesh alone, not on its light.
        let used = (0..self.corners.len() as u32).into_par_iter().with_min_len(1024).filter_map(|index| {
            let Corner { from: (from, weight), around, .. } = &self.corners[index as usize];
            (!around.is_empty()).then_some((*from, weight.to_bits(), index))
        });
        let mut used: Vec<([u32; 2], u64, u32)> = used.collect();
        used.par_sort_unstable();
        let mut vertices = Vec::with_capacity(used.len());
        let mut sources: Vec<u32> = Vec::with_capacity(used.len());
        let mut number = vec![NONE; self.corners.len()];
        for (_, _, index) in used {
            let Corner { position, normal, from: (from, weight), .. } = self.corners[index as usize];
            let mut new = || {
                vertices.push(LitVertex { position, normal, irradiance: DVec3::ZERO });
                sources.push(index);
                vertices.len() as u32 - 1
            };
            // A fit may differ from surface to surface.
            number[index as usize] = if fit.is_some() {
                new()
            } else {
                *known.entry((from, weight.to_bits(), bits(position))).or_insert_with(new)
            };
        }
        vertices.shrink_to_fit();
        for (_, triangle) in self.alive() {
            let vertices = triangle.corners.map(|corner| number[corner as usize]);
            surfaces[triangle.surface as usize].push(LitTriangle { facet: triangle.facet, vertices });
        }
        let left = |of_corners: &[DVec3]| -> Vec<DVec3> {
            sources.iter().map(|corner| of_corners[*corner as usize]).collect()
        };
        let moved = |values: &[DVec3]| -> Vec<DVec3> {
            let of_corners = self.of_corners(values);
            left(&fit.map_or_else(|| of_corners.clone(), |fit| fit.apply(&of_corners)))
        };
        let unfitted = || -> Vec<DVec3> {
            let irradiance: Vec<DVec3> = lit.vertices.iter().map(|vertex| vertex.irradiance).collect();
            self.of_corners(&irradiance)
        };
        let (irradiance, unshot) = rayon::join(
            || fit.map_or_else(|| left(&unfitted()), |fit| left(&fit.irradiance)),
            || if lit.unshot.is_empty() { vec![] } else { moved(&lit.unshot) },
        );
        let is_dark: Vec<_> = irradiance.iter().map(|irradiance| irradiance.cmple(DVec3::ZERO)).collect();
        for (vertex, irradiance) in vertices.iter_mut().zip(irradiance) {
            vertex.irradiance = if fit.is_some() { irradiance.max(DVec3::ZERO) } else { irradiance };
        }
        // Where the whole fell below 0, all parts are 0.
        let layer = |layer: &LitLayer| {
            let light = moved(&layer.irradiance).into_iter().zip(&is_dark);
            let irradiance = light.map(|(light, is_dark)| DVec3::select(*is_dark, DVec3::ZERO, light));
            LitLayer { irradiance: irradiance.collect(), ..layer.clone() }
        };
        let layers = lit.layers.par_iter().map(layer).collect();
        LitMesh { vertices, surfaces, layers, unshot, ..LitMesh::default() }
    }
}
