//! The dark insides of closed bodies, which the bake leaves out, as the input has them.

use foldhash::{HashMap, HashMapExt};
use glam::DVec3;

use crate::lit::{LitMesh, LitTriangle, LitVertex};
use scene::Scene;

/// Adds the triangles of sealed facets, without light.
pub fn add_sealed(scene: &Scene, mut lit: LitMesh) -> LitMesh {
    let bits = |vector: DVec3| vector.to_array().map(f64::to_bits);
    for (surface, triangles) in scene.surfaces.iter().zip(&mut lit.surfaces) {
        let mut known = HashMap::new();
        for (facet, own) in (0..).zip(&surface.facets).filter(|(_, own)| own.is_sealed) {
            for positions in own.positions_of_triangles() {
                let vertices = positions.map(|position| {
                    let corner = own.corners.iter().find(|corner| corner.position == position);
                    let normal = corner.map_or(own.normal, |corner| corner.normal);
                    *known.entry((bits(position), bits(normal))).or_insert_with(|| {
                        lit.vertices.push(LitVertex { position, normal, irradiance: DVec3::ZERO });
                        lit.vertices.len() as u32 - 1
                    })
                });
                triangles.push(LitTriangle { facet, vertices });
            }
        }
    }
    let count = lit.vertices.len();
    lit.layers.iter_mut().for_each(|layer| layer.irradiance.resize(count, DVec3::ZERO));
    if !lit.unshot.is_empty() {
        lit.unshot.resize(count, DVec3::ZERO);
    }
    lit
}
