//! The triangles of a lit mesh while they are changed.

use foldhash::{HashMap, HashMapExt, HashSet};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use smallvec::SmallVec;

use super::grid::bits;
use super::linear::{LightIn, Region, Sample};
use crate::lit::{LitMesh, LitVertex};
use crate::refinement::LEAST_WEIGHT;
use scene::{Scene, Surface};

/// No vertex: the corners of a triangle that is gone.
pub const NONE: u32 = u32::MAX;

/// A vertex of one surface. Several may lie at one position: those of other surfaces, sides and directions.
#[derive(Debug, Clone)]
pub struct Corner {
    /// Position in the frame.
    pub position: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Radiosity: irradiance times the reflectance by which errors are weighted.
    pub light: DVec3,
    /// Where its values come from: two vertices of the lit mesh, and the weight of the second.
    pub from: ([u32; 2], f64),
    pub surface: u32,
    /// It is a corner of the input, which does not move.
    pub fixed: bool,
    /// Its place in `Working::points`.
    pub point: u32,
    /// The triangles around it.
    pub around: SmallVec<[u32; 8]>,
}

/// A triangle.
#[derive(Debug, Clone)]
pub struct Triangle {
    pub corners: [u32; 3],
    pub surface: u32,
    pub facet: u32,
    /// Where triangles may be exchanged: on one plane, and inside one facet where the file's attributes or the normals vary.
    pub region: u32,
    /// Samples that lie in it.
    pub samples: Vec<u32>,
}

impl Triangle {
    /// The edges, as they are walked.
    pub fn edges(&self) -> [[u32; 2]; 3] {
        let [a, b, c] = self.corners;
        [[a, b], [b, c], [c, a]]
    }

    /// The edges, each with the lesser corner first.
    pub fn sorted_edges(&self) -> [(u32, u32); 3] {
        self.edges().map(|[a, b]| (a.min(b), a.max(b)))
    }
}

/// The mesh while it is changed.
#[derive(Debug, Clone)]
pub struct Working {
    pub corners: Vec<Corner>,
    pub triangles: Vec<Triangle>,
    pub regions: Vec<Region>,
    /// Reflectance by which errors are weighted, by surface.
    pub weights: Vec<DVec3>,
    /// Corners that are collapsed together.
    pub points: Vec<SmallVec<[u32; 2]>>,
    pub samples: Vec<Sample>,
    /// Largest extent of the scene.
    pub extent: f64,
}

/// What distinguishes regions of a surface: plane and direction, or the facet.
#[derive(PartialEq, Eq, Hash)]
enum RegionKey {
    Plane(u32, bool),
    Facet(u32),
}

/// Distinguishes the two directions of a plane.
const NO_COMMON_NORMAL: DVec3 = DVec3::new(0.537_7, 0.651_3, 0.535_4);

impl Working {
    /// The triangles of a lit mesh.
    pub fn new(scene: &Scene, lit: &LitMesh) -> Self {
        let facets = || scene.surfaces.iter().flat_map(|surface| &surface.facets);
        // Pieces that import cut have corners that the input has not.
        let positions = || facets().flat_map(|f| &f.triangles).flat_map(|triangle| triangle.positions);
        let (fixed, mut working) = rayon::join(
            || positions().map(bits).collect::<HashSet<[u64; 3]>>(),
            || Self::movable(scene, lit),
        );
        let corners = working.corners.par_iter_mut().with_min_len(1024);
        corners.for_each(|corner| corner.fixed = fixed.contains(&bits(corner.position)));
        working
    }

    /// The same, without corners that do not move.
    fn movable(scene: &Scene, lit: &LitMesh) -> Self {
        let mut working = Self {
            corners: Vec::with_capacity(lit.vertices.len() * 9 / 8),
            triangles: Vec::with_capacity(lit.surfaces.iter().map(Vec::len).sum()),
            regions: vec![],
            weights: scene
                .surfaces
                .iter()
                .map(|surface| surface.reflectance.max(DVec3::splat(LEAST_WEIGHT)))
                .collect(),
            points: vec![],
            samples: vec![],
            extent: crate::context::extent(scene),
        };
        let mut of_vertex = vec![NONE; lit.vertices.len()];
        let mut used: Vec<u32> = vec![];
        for (index, (surface, triangles)) in scene.surfaces.iter().zip(&lit.surfaces).enumerate() {
            let weight = working.weights[index];
            let has_attributes = has_attributes(scene, surface);
            let mut regions = HashMap::new();
            used.extend(triangles.iter().flat_map(|triangle| triangle.vertices));
            used.sort_unstable();
            used.dedup();
            for vertex in &used {
                of_vertex[*vertex as usize] = working.corners.len() as u32;
                let LitVertex { position, normal, irradiance } = lit.vertices[*vertex as usize];
                working.corners.push(Corner {
                    position,
                    normal,
                    light: weight * irradiance,
                    from: ([*vertex; 2], 0.0),
                    surface: index as u32,
                    fixed: false,
                    point: NONE,
                    around: SmallVec::new(),
                });
            }
            for triangle in triangles {
                let facet = &surface.facets[triangle.facet as usize];
                let is_flat = triangle
                    .vertices
                    .iter()
                    .all(|vertex| lit.vertices[*vertex as usize].normal.dot(facet.normal) > 1.0 - 1e-9);
                let key = if is_flat && !has_attributes {
                    RegionKey::Plane(facet.plane.0, facet.normal.dot(NO_COMMON_NORMAL) > 0.0)
                } else {
                    RegionKey::Facet(triangle.facet)
                };
                let region = *regions.entry(key).or_insert_with(|| {
                    working.regions.push(Region::new(facet.normal));
                    working.regions.len() as u32 - 1
                });
                let corners = triangle.vertices.map(|vertex| of_vertex[vertex as usize]);
                let surface = index as u32;
                working.add(Triangle { corners, surface, facet: triangle.facet, region, samples: vec![] });
            }
            used.drain(..).for_each(|vertex| of_vertex[vertex as usize] = NONE);
        }
        working
    }

    /// Adds a triangle.
    pub fn add(&mut self, triangle: Triangle) {
        let index = self.triangles.len() as u32;
        for corner in triangle.corners {
            self.corners[corner as usize].around.push(index);
        }
        self.triangles.push(triangle);
    }

    /// Takes a triangle from its corners.
    pub fn detach(&mut self, index: u32) {
        for corner in self.triangles[index as usize].corners {
            self.corners[corner as usize].around.retain(|around| *around != index);
        }
    }

    /// Removes a triangle.
    pub fn remove(&mut self, index: u32) {
        self.detach(index);
        self.triangles[index as usize].corners = [NONE; 3];
    }

    /// Triangles that are left.
    pub fn alive(&self) -> impl Iterator<Item = (u32, &Triangle)> {
        (0..).zip(&self.triangles).filter(|(_, triangle)| triangle.corners[0] != NONE)
    }

    /// Radiosity of a corner with this irradiance, as errors are weighted.
    pub fn weighted(&self, corner: &Corner, irradiance: DVec3) -> DVec3 {
        self.weights[corner.surface as usize] * irradiance
    }

    /// Gives all corners this irradiance.
    pub fn take(&mut self, irradiance: &[DVec3]) {
        for (corner, irradiance) in self.corners.iter_mut().zip(irradiance) {
            corner.light = self.weights[corner.surface as usize] * *irradiance;
        }
    }

    /// Values of all corners, given those of the lit mesh's vertices.
    pub fn of_corners(&self, values: &[DVec3]) -> Vec<DVec3> {
        let of_corner = |corner: &Corner| {
            let ([a, b], weight) = corner.from;
            values[a as usize].lerp(values[b as usize], weight)
        };
        self.corners.iter().map(of_corner).collect()
    }

    /// Position of a corner.
    pub fn at(&self, corner: u32) -> DVec3 {
        self.corners[corner as usize].position
    }

    /// Corner of a triangle as its region sees it.
    pub fn flat(&self, region: u32, corner: u32) -> DVec2 {
        self.regions[region as usize].flat(self.at(corner))
    }

    /// The triangles that have both corners.
    pub fn along(&self, a: u32, b: u32) -> impl Iterator<Item = u32> + '_ {
        let has_b = move |triangle: &u32| self.triangles[*triangle as usize].corners.contains(&b);
        self.corners[a as usize].around.iter().copied().filter(has_b)
    }

    /// The two triangles on both sides of an edge inside a region.
    pub fn both_sides(&self, a: u32, b: u32) -> Option<[u32; 2]> {
        let mut along = self.along(a, b);
        let both = [along.next()?, along.next()?];
        let [one, other] = both.map(|triangle| self.triangles[triangle as usize].region);
        (along.next().is_none() && one == other).then_some(both)
    }
}

impl Working {
    /// The light between three corners.
    pub fn light_between(&self, region: u32, corners: [u32; 3]) -> LightIn {
        let of = |corner: u32| self.corners[corner as usize].light;
        LightIn::new(self.regions[region as usize], corners.map(|corner| self.at(corner)), corners.map(of))
    }

    /// The light in a triangle.
    pub fn light_in(&self, triangle: &Triangle) -> LightIn {
        self.light_between(triangle.region, triangle.corners)
    }

    /// Area of a triangle.
    pub fn area(&self, triangle: &Triangle) -> f64 {
        let [a, b, c] = triangle.corners.map(|corner| self.at(corner));
        (b - a).cross(c - a).length() / 2.0
    }
}

/// Returns true if the file has values at the surface's vertices, which may change from facet to facet.
fn has_attributes(scene: &Scene, surface: &Surface) -> bool {
    let root = &scene.source.root;
    let mesh = root.nodes.get(surface.node).and_then(|node| root.get(node.mesh?));
    let primitive = mesh.and_then(|mesh| mesh.primitives.get(surface.primitive));
    let beside = |primitive: &gltf::json::mesh::Primitive| {
        primitive.attributes.keys().any(|key| {
            !matches!(
                key,
                gltf::json::validation::Checked::Valid(gltf::Semantic::Positions | gltf::Semantic::Normals)
            )
        })
    };
    surface.appearance.is_some() || primitive.is_some_and(beside)
}
