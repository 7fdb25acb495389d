//! How radiosity differs within shares.

use glam::DVec3;
use kernel::geometry::area_vector;
use rayon::prelude::*;
use scene::Scene;
use smallvec::SmallVec;

use super::share_mesh::ShareMesh;
use super::weights::add_quarter;
use crate::mesh::{Mesh, Patch, PatchId, Share, overlap};

/// Patches that a thread takes at a time.
const AT_ONCE: usize = 256;

/// Radiosity of the shares, and within them where that is known.
#[derive(Clone, Copy)]
pub struct Radiosity<'a> {
    /// Of each share.
    pub shares: &'a [DVec3],
    /// Of their parts.
    pub local: Option<&'a LocalRadiosity>,
}

impl<'a> Radiosity<'a> {
    /// Shares whose parts are all alike.
    pub fn even(shares: &'a [DVec3]) -> Self {
        Self { shares, local: None }
    }

    /// Of each share, where it counts as a whole.
    pub fn wholes(self) -> &'a [DVec3] {
        self.local.map_or(self.shares, |local| &local.wholes)
    }
}

/// A part of a share.
#[derive(Debug, Clone, Copy)]
pub enum Part {
    /// A patch.
    Patch(PatchId),
    /// What belongs to a corner of a patch that is not divided.
    Quarter(PatchId, usize),
}

/// A mean over the exposed area of a part.
#[derive(Debug, Clone, Copy, Default)]
pub struct Mean {
    /// Mean radiosity.
    pub radiosity: DVec3,
    /// The area; none where the part sees no surface.
    pub area: f64,
}

impl Mean {
    /// The mean of parts.
    fn of(parts: impl Iterator<Item = Self>) -> Self {
        let (flux, area) = parts.fold((DVec3::ZERO, 0.0), |(flux, area), part| {
            (flux + part.radiosity * part.area, area + part.area)
        });
        if area > 0.0 { Self { radiosity: flux / area, area } } else { Self::default() }
    }
}

/// Radiosity of the parts of shares, from the irradiance of vertices.
#[derive(Clone)]
pub struct LocalRadiosity {
    /// Of each patch that there was.
    patches: Vec<Mean>,
    /// Of the quarters of each, in the order of its corners; none of divided patches.
    quarters: Vec<SmallVec<[Mean; 4]>>,
    /// The parts of each share, and the mean over them.
    shares: Vec<(Vec<Part>, Mean)>,
    /// Radiosity of each share, where it counts as a whole.
    wholes: Vec<DVec3>,
}

impl LocalRadiosity {
    /// The radiosity where the vertices get this irradiance, of which only what is exposed sees any surface, and shares have this one
    /// as wholes.
    pub fn new(
        scene: &Scene,
        mesh: &ShareMesh,
        exposed: &[bool],
        irradiance: &[DVec3],
        wholes: Vec<DVec3>,
    ) -> Self {
        let of = &mesh.mesh;
        let quarters_of = |(index, patch): (usize, &Patch)| -> SmallVec<[Mean; 4]> {
            if patch.first_child.is_some() {
                return SmallVec::new();
            }
            let id = PatchId(index as u32);
            let reflectance = mesh.patch_materials.of(scene, of, id).reflectance;
            let quarter = |corner| {
                let irradiance = mean_of_quarter(of, (id, corner), exposed, irradiance);
                Mean { radiosity: reflectance * irradiance.radiosity, ..irradiance }
            };
            (0..patch.corners.len()).map(quarter).collect()
        };
        let patches = of.patches.par_iter().enumerate().with_min_len(AT_ONCE);
        let quarters: Vec<_> = patches.map(quarters_of).collect();
        let mut local =
            Self { patches: vec![Mean::default(); of.patches.len()], quarters, shares: vec![], wholes };
        // Children follow their parents.
        for id in (0..of.patches.len() as u32).rev().map(PatchId) {
            let corners = 0..of.patch(id).corners.len();
            let parts = corners.map(|corner| local.of_part(local.part(of, id, corner)));
            local.patches[id.index()] = Mean::of(parts);
        }
        let of_share = |share: &Share| {
            let parts = local.parts_of(of, share);
            let mean = Mean::of(parts.iter().map(|part| local.of_part(*part)));
            (parts, mean)
        };
        local.shares = mesh.shares.par_iter().with_min_len(AT_ONCE).map(of_share).collect();
        local
    }

    fn parts_of(&self, mesh: &Mesh, share: &Share) -> Vec<Part> {
        let mut parts: Vec<Part> =
            share.corners.iter().map(|(id, corner)| self.part(mesh, *id, *corner)).collect();
        for (id, polygon) in &share.overlaps {
            self.add_parts_within(mesh, &share.polygons[*polygon].corners, *id, &mut parts);
        }
        parts
    }

    /// Adds the parts of a patch that lie within a polygon of its plane, quarters of leaves by half or more.
    fn add_parts_within(&self, mesh: &Mesh, polygon: &[DVec3], id: PatchId, parts: &mut Vec<Part>) {
        let corners = mesh.corners(id);
        let covered = overlap(polygon, &corners);
        if covered.is_empty() {
            return;
        }
        if covered[..] == corners[..] {
            parts.push(Part::Patch(id));
            return;
        }
        for corner in 0..corners.len() {
            match self.part(mesh, id, corner) {
                Part::Patch(child) => self.add_parts_within(mesh, polygon, child, parts),
                quarter @ Part::Quarter(..) => {
                    let quad = mesh.corner_quad(id, corner);
                    let within = area_vector(&overlap(polygon, &quad)).length();
                    if within >= 0.5 * area_vector(&quad).length() {
                        parts.push(quarter);
                    }
                }
            }
        }
    }

    /// The part of a patch at one of its corners.
    pub fn part(&self, mesh: &Mesh, id: PatchId, corner: usize) -> Part {
        let child = mesh.patch(id).first_child.map(|first| PatchId(first.0 + corner as u32));
        // What was divided since then is as it was.
        let is_known = |child: &PatchId| child.index() < self.patches.len();
        child.filter(is_known).map_or(Part::Quarter(id, corner), Part::Patch)
    }

    /// The parts of a share.
    pub fn parts(&self, share: usize) -> &[Part] {
        &self.shares[share].0
    }

    /// Mean over a part.
    pub fn of_part(&self, part: Part) -> Mean {
        match part {
            Part::Patch(id) => self.patches[id.index()],
            Part::Quarter(id, corner) => self.quarters[id.index()][corner],
        }
    }

    /// Mean radiosity of the parts of a share.
    pub fn of_share(&self, share: usize) -> DVec3 {
        self.shares[share].1.radiosity
    }
}

/// Mean over a quarter of a leaf of what its exposed corners get.
fn mean_of_quarter(
    mesh: &Mesh,
    (id, corner): (PatchId, usize),
    exposed: &[bool],
    irradiance: &[DVec3],
) -> Mean {
    let mut weights = vec![];
    add_quarter(mesh, id, corner, 1.0, &mut weights);
    let exposed = weights.into_iter().filter(|(vertex, _)| exposed[*vertex]);
    Mean::of(exposed.map(|(vertex, weight)| Mean { radiosity: irradiance[vertex], area: weight }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{SIZE, divide, overlaid};

    /// Light that rises from one side of a square to the other is known within shares of another mesh, too.
    #[test]
    fn shares_of_another_mesh_have_parts() {
        let (scene, mut mesh, shares) = overlaid(40);
        // Quarters of leaves are then smaller than shares.
        [1, 1, 3].into_iter().for_each(|every| divide(&mut mesh, every));
        let light = |x: f64| DVec3::splat(1.0 + x / SIZE);
        let irradiance: Vec<DVec3> = mesh.vertices.iter().map(|vertex| light(vertex.position.x)).collect();
        let mesh = ShareMesh::new(&scene, mesh, shares);
        let local = LocalRadiosity::new(&scene, &mesh, &vec![true; irradiance.len()], &irradiance, vec![]);
        for (index, share) in mesh.shares.iter().enumerate() {
            let covered: f64 = local.parts(index).iter().map(|part| local.of_part(*part).area).sum();
            assert!((0.4..1.4).contains(&(covered / share.area)), "{covered} of {}", share.area);
            let centroids = share.polygons.iter().map(|polygon| {
                let middle = polygon.corners.iter().sum::<DVec3>() / polygon.corners.len() as f64;
                middle * polygon.area() / share.area
            });
            let expected = 0.5 * light(centroids.sum::<DVec3>().x);
            let off = (local.of_share(index) - expected).x;
            assert!(off.abs() < 0.02, "{expected} is off by {off}");
        }
    }
}
