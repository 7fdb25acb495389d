use foldhash::{HashMap, HashMapExt};

use glam::DVec3;
use kernel::disjoint_sets::DisjointSets;
use kernel::geometry::Bounds;
use rayon::prelude::*;

use scene::{Facet, Scene, Surface};

/// A flat part of a surface: facets of one plane and direction that share edges.
pub struct Region {
    /// Index of the surface.
    pub surface: usize,
    /// Indices of its facets, ascending.
    pub facets: Vec<u32>,
    /// Length of the diagonal of its box.
    pub size: f64,
}

impl Region {
    /// Its facets, with their indices.
    pub fn facets<'a>(&self, scene: &'a Scene) -> Vec<(u32, &'a Facet)> {
        let facets = &scene.surfaces[self.surface].facets;
        self.facets.iter().map(|index| (*index, &facets[*index as usize])).collect()
    }

    /// Area over size: the width of a strip, half the height of a triangle.
    pub fn width(&self, scene: &Scene) -> f64 {
        let area: f64 = self.facets(scene).iter().map(|(_, facet)| facet.polygon().area()).sum();
        area / self.size
    }
}

/// The regions of a scene that light may reach, in the order of surfaces and of their first facets.
pub fn regions(scene: &Scene) -> Vec<Region> {
    let of = |(index, surface): (usize, &Surface)| regions_of(index, surface);
    scene.surfaces.par_iter().enumerate().flat_map_iter(of).collect()
}

fn regions_of(index: usize, surface: &Surface) -> Vec<Region> {
    let mut joined = DisjointSets::new(surface.facets.len());
    let mut leaving: HashMap<[[u64; 3]; 2], usize> = HashMap::new();
    let is_flat = |facet: &Facet| facet.corners.iter().all(|corner| corner.normal == facet.normal);
    for (number, facet) in surface.lit_facets().filter(|(_, facet)| is_flat(facet)) {
        for [from, to] in edges(facet) {
            if let Some(other) = leaving.get(&[to, from]) {
                let near = &surface.facets[*other];
                if near.plane == facet.plane && near.normal.dot(facet.normal) > 0.0 {
                    joined.join(number, *other);
                }
            }
            leaving.insert([from, to], number);
        }
    }
    let mut members: Vec<Vec<u32>> = vec![vec![]; surface.facets.len()];
    // No light reaches the sealed ones.
    for (facet, _) in surface.lit_facets() {
        members[joined.representative(facet)].push(facet as u32);
    }
    let region = |facets: Vec<u32>| {
        let positions = facets.iter().flat_map(|facet| surface.facets[*facet as usize].positions());
        let size = Bounds::around(positions).extent().length();
        Region { surface: index, facets, size }
    };
    members.into_iter().filter(|facets| !facets.is_empty()).map(region).collect()
}

/// Ends of the edges of a facet, by the bits of their coordinates: facets that share an edge got it from the same numbers.
fn edges(facet: &Facet) -> impl Iterator<Item = [[u64; 3]; 2]> + '_ {
    let bits = |position: DVec3| position.to_array().map(f64::to_bits);
    let next = facet.positions().cycle().skip(1);
    facet.positions().zip(next).map(move |(a, b)| [bits(a), bits(b)])
}
