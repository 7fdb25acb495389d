//! The lit mesh of a bake, done or under way.

use glam::DVec3;

use super::receivers;
use super::settle::Means;
use super::{Bake, LightPart, Phase};
use crate::lit::LitMesh;
use crate::mesh::{Mesh, Share, VertexId, triangulate};
use crate::solver::fit::{best_fit, best_fit_of_part};
use scene::Scene;

impl Bake<'_, '_> {
    /// The mesh as it is now with this irradiance of its vertices, of which so much is direct, and the fitted values of all of the
    /// light.
    pub(super) fn lit(&self, irradiance: &[DVec3], direct: &[DVec3]) -> (LitMesh, Vec<DVec3>) {
        lit_mesh(self.scene, &self.mesh, self.settings.only, irradiance, direct)
    }

    /// Hands over what is known now, if it is wanted.
    pub(super) fn show(&mut self) {
        // The light of a group alone is not what the bake knows.
        if self.office.phase() != Phase::Groups && self.office.wants_present() {
            let unshot = self.unshot_of_shares();
            let lit = self.state(self.irradiance_so_far(), &unshot);
            self.office.present(lit);
        }
    }

    /// The state with this irradiance of the vertices and this unshot radiosity of the shares.
    pub(super) fn state(&self, irradiance: &[DVec3], unshot: &[DVec3]) -> LitMesh {
        let unshot = at_vertices(&self.mesh, &self.shares, unshot);
        let (lit, _) = self.lit(irradiance, &self.direct);
        LitMesh { unshot, ..lit }
    }

    /// Irradiance of the vertices: before any reflection, what the sources give.
    fn irradiance_so_far(&self) -> &[DVec3] {
        if self.irradiance.is_empty() { &self.direct } else { &self.irradiance }
    }

    /// What each share should shoot by what it gets now, less what it has shot.
    fn unshot_of_shares(&self) -> Vec<DVec3> {
        let irradiance = self.irradiance_so_far();
        let at_shares: Vec<DVec3> = if self.is_gathered || self.takes_means {
            // Nothing is known to be dark before the rows were looked at.
            let mut exposed = self.exposed.clone();
            exposed.resize(irradiance.len(), true);
            Means::new(&self.mesh, &self.shares, &exposed).of(irradiance)
        } else {
            self.energies.iter().map(|share| irradiance[share.receiver]).collect()
        };
        let states = self.energies.iter().zip(at_shares).zip(&self.radiosity);
        states.map(|((share, irradiance), shot)| share.reflectance * irradiance - *shot).collect()
    }
}

/// A part of the light on a mesh, with this irradiance of its vertices, of which so much is direct; and the fitted values of all of it.
pub(super) fn lit_mesh(
    scene: &Scene,
    mesh: &Mesh,
    part: LightPart,
    irradiance: &[DVec3],
    direct: &[DVec3],
) -> (LitMesh, Vec<DVec3>) {
    let shown =
        (!part.is_all()).then(|| best_fit_of_part(mesh, irradiance, &part.of_all(irradiance, direct)));
    let fitted = best_fit(mesh, irradiance);
    let triangles = triangulate(mesh, scene.surfaces.len(), |vertex: VertexId| fitted[vertex.index()]);
    let lit = receivers::lit_mesh(mesh, shown.as_deref().unwrap_or(&fitted), triangles);
    (lit, fitted)
}

/// A figure of each share at all vertices: at those of the shooting mesh the mean of the shares that meet there, by area, and
/// interpolated where patches were divided since.
fn at_vertices(mesh: &Mesh, shares: &[Share], of_shares: &[DVec3]) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0.0); mesh.vertices.len()];
    for (share, value) in shares.iter().zip(of_shares) {
        let area = share.area / share.corners.len() as f64;
        for (patch, corner) in &share.corners {
            let (sum, weight) = &mut sums[mesh.patch(*patch).corners[*corner].index()];
            *sum += *value * area;
            *weight += area;
        }
    }
    let mut values: Vec<Option<DVec3>> =
        sums.into_iter().map(|(sum, weight)| (weight > 0.0).then(|| sum / weight)).collect();
    // A patch comes before its children.
    for patch in &mesh.patches {
        let Some(first) = patch.first_child else { continue };
        let of = |values: &[Option<DVec3>], vertex: VertexId| values[vertex.index()].unwrap_or_default();
        let mean = |values: &[Option<DVec3>], of_corners: &[VertexId]| {
            of_corners.iter().map(|corner| of(values, *corner)).sum::<DVec3>() / of_corners.len() as f64
        };
        for (index, corner) in patch.corners.iter().enumerate() {
            let next = patch.corners[(index + 1) % patch.corners.len()];
            if let Some(middle) = mesh.middle_of(*corner, next) {
                let value = mean(&values, &[*corner, next]);
                values[middle.index()].get_or_insert(value);
            }
        }
        // Each child has the centre opposite to its parent's corner.
        let centre = mesh.patch(first).corners[2];
        let value = mean(&values, &patch.corners);
        values[centre.index()].get_or_insert(value);
    }
    values.into_iter().map(Option::unwrap_or_default).collect()
}
