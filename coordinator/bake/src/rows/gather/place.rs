//! Where gather points lie: the more of them, the worse interpolation between them is.

use glam::DVec3;
use kernel::replica::{Receiver, Receivers};
use rayon::prelude::*;

use super::hemisphere::{View, gathered, views};
use super::interpolation::{Interpolation, Neighbours, Weights, interpolated};
use super::{GatherRows, TWIN_KEYS, TWINS, Twins};
use crate::context::Context;
use crate::error::Result;
use crate::error_budget::without_noise;
use crate::jobs::ReceiverSet;
use crate::mesh::{PatchId, Share};
use crate::refinement::{MOST_DRAWN, SamplePoints};
use crate::rows::means::ShareValues;
use crate::rows::share_mesh::ShareMesh;
use scene::Scene;

/// Meshes of no more vertices cast rays from each.
const FEW_VERTICES: usize = 1 << 13;

/// Points to begin with.
const FIRST_POINTS: usize = 1024;

/// Most points.
const MOST_POINTS: usize = 1 << 13;

/// Part of the asked error that interpolation between the points may have.
const PART: f64 = 0.4;

/// Key of the first point as a receiver, above those of all samples.
const FIRST_KEY: u64 = 1 << 36;

/// Rounds of drawing, each with seeds of its own: above those of samples.
const FIRST_ROUND: u32 = 1 << 16;

/// Passes in which light goes between points and shares before points are added: enough to tell where it changes.
const PASSES: u32 = 8;

impl GatherRows {
    /// Places gather points until the light between them is known as well as the asked error wants it. Returns a first radiosity of the
    /// shares, given the direct light of the vertices.
    pub(super) fn place(
        &mut self,
        cx: &mut Context,
        mesh: &ShareMesh,
        direct: &[DVec3],
    ) -> Result<Vec<DVec3>> {
        let asked = cx.settings.error.unwrap_or(cx.settings.mesh_error);
        let values = ShareValues::means(mesh, &vec![true; direct.len()]);
        let direct = values.of(&mesh.energies, direct);
        let receivers = receivers_of(cx.scene, mesh);
        let area: f64 = mesh.energies.iter().map(|share| share.area).sum();
        let mut radiosity: Vec<DVec3> =
            mesh.energies.iter().zip(&direct).map(|(share, light)| share.reflectance * *light).collect();
        let Some(polygons) = self.polygons else { return Ok(radiosity) };
        if direct.len() <= FEW_VERTICES {
            self.place_twins(cx, mesh, polygons)?;
            return Ok(radiosity);
        }
        let mut expected = vec![];
        let mut count = FIRST_POINTS;
        for round in 0.. {
            let seed = (cx.settings.seed, FIRST_ROUND + round);
            let first_key = FIRST_KEY + u64::from(round) * MOST_DRAWN as u64;
            let drawn =
                SamplePoints::draw_everywhere(&mesh.mesh, cx.scene, seed, first_key, &expected, count);
            let fresh = drawn.receivers(count);
            let seen = views(cx.client, polygons, &self.share_of, &fresh, |_| self.rays)?;
            let mut errors = self.errors_at(cx, &fresh.receivers, &seen, &radiosity);
            self.points.add_shared(&fresh.receivers, seen);
            if round == 0 {
                self.add_twins(cx, polygons, drawn.clone())?;
            }
            let Some(neighbours) = self.neighbours(cx) else { break };
            let of_shares = nearest(&neighbours, &receivers);
            for _ in 0..PASSES {
                let indirect = of_shares.of(&self.points.gather(&radiosity));
                let all = mesh.energies.iter().zip(&direct).zip(indirect);
                radiosity =
                    all.map(|((share, direct), light)| share.reflectance * (*direct + light)).collect();
            }
            let left_out = self.errors_left_out(&radiosity, &neighbours);
            if round == 0 {
                errors.clone_from(&left_out);
            }
            let all: f64 =
                mesh.energies.iter().zip(&radiosity).map(|(share, b)| share.area * b.length_squared()).sum();
            let relative = |square: f64| if all > 0.0 { (square * area / all).sqrt() } else { 0.0 };
            // The fresh light is noisy, and so is that between the points, less.
            let noise = relative(self.twins.square_noise(&self.points, &radiosity) * 1.5);
            let error = without_noise(relative(drawn.mean_square_error(&errors)), noise);
            tracing::debug!(points = self.points.shared, error, noise, "gather points placed");
            if error <= PART * asked || self.points.shared >= MOST_POINTS {
                break;
            }
            expected = expected_errors(cx.scene, mesh, &left_out, &neighbours);
            count = (self.points.shared / 2).clamp(FIRST_POINTS, MOST_DRAWN);
        }
        Ok(radiosity)
    }

    /// Where each vertex casts rays of its own, points tell the noise alone.
    fn place_twins(&mut self, cx: &mut Context, mesh: &ShareMesh, polygons: ReceiverSet) -> Result<()> {
        let seed = (cx.settings.seed, FIRST_ROUND);
        let drawn = SamplePoints::draw_everywhere(&mesh.mesh, cx.scene, seed, FIRST_KEY, &[], TWINS);
        let receivers = drawn.receivers(TWINS);
        let seen = views(cx.client, polygons, &self.share_of, &receivers, |_| self.rays)?;
        self.points.add_alone(&receivers.receivers, seen);
        self.add_twins(cx, polygons, drawn)
    }

    /// Looks from the first points again, with other rays.
    fn add_twins(&mut self, cx: &mut Context, polygons: ReceiverSet, points: SamplePoints) -> Result<()> {
        let Receivers { first_key, receivers } = points.receivers(TWINS);
        let again = Receivers { first_key: first_key + TWIN_KEYS, receivers };
        let views = views(cx.client, polygons, &self.share_of, &again, |_| self.rays)?;
        self.twins = Twins { points, views };
        Ok(())
    }

    /// Errors of interpolation at receivers with these views. Receivers that are alone get rays of their own.
    fn errors_at(
        &self,
        cx: &Context,
        receivers: &[Receiver],
        views: &[View],
        radiosity: &[DVec3],
    ) -> Vec<DVec3> {
        let known = self.points.gather(radiosity);
        let Some(neighbours) = self.neighbours(cx) else { return vec![] };
        let error = |(receiver, view): (&Receiver, &View)| {
            let weights = neighbours.weights(receiver, 0.0, None);
            weights.map_or(DVec3::ZERO, |weights| interpolated(&weights, &known) - gathered(view, radiosity))
        };
        receivers.par_iter().zip(views).with_min_len(64).map(error).collect()
    }

    /// Errors of interpolation at the points, where each is left out itself.
    fn errors_left_out(&self, radiosity: &[DVec3], neighbours: &Neighbours) -> Vec<DVec3> {
        let light = self.points.gather(radiosity);
        let points = self.points.receivers[..self.points.shared].par_iter().zip(&light).enumerate();
        let error = |(point, (receiver, own)): (usize, (&Receiver, &DVec3))| {
            let weights = neighbours.weights(receiver, 0.0, Some(point as u32));
            weights.map_or(DVec3::ZERO, |weights| interpolated(&weights, &light) - *own)
        };
        points.with_min_len(64).map(error).collect()
    }
}

/// Square error expected of each leaf of the mesh, in their order: that of the nearest point.
fn expected_errors(scene: &Scene, mesh: &ShareMesh, errors: &[DVec3], neighbours: &Neighbours) -> Vec<f64> {
    let leaves: Vec<PatchId> = mesh.mesh.leaves().map(|(id, _)| id).collect();
    let expected = |id: PatchId| {
        let nearest = neighbours.nearest(&receiver_of_leaf(scene, mesh, id)).unwrap_or(0);
        let patch = mesh.mesh.patch(id);
        let reflectance = scene.surfaces[patch.surface as usize].reflectance;
        patch.area * errors[nearest as usize].length_squared() * reflectance.length_squared()
    };
    leaves.into_par_iter().with_min_len(256).map(expected).collect()
}

/// A receiver in the middle of the largest leaf of each share.
fn receivers_of(scene: &Scene, mesh: &ShareMesh) -> Vec<Receiver> {
    let largest = |share: &Share| {
        let area = |id: PatchId| mesh.mesh.patch(id).area;
        share.corners.iter().map(|(id, _)| *id).reduce(|a, b| if area(b) > area(a) { b } else { a })
    };
    let ids = mesh.shares.iter().filter_map(largest);
    ids.map(|id| receiver_of_leaf(scene, mesh, id)).collect()
}

/// A receiver in the middle of a leaf.
fn receiver_of_leaf(scene: &Scene, mesh: &ShareMesh, id: PatchId) -> Receiver {
    let patch = mesh.mesh.patch(id);
    let facet = &scene.surfaces[patch.surface as usize].facets[patch.facet as usize];
    Receiver { position: mesh.mesh.centre(id), normal: facet.normal, plane: facet.plane }
}

/// The nearest of the points for each of some receivers: near enough to tell where points are needed.
fn nearest(neighbours: &Neighbours, receivers: &[Receiver]) -> Interpolation {
    let weights = |receiver: &Receiver| neighbours.nearest(receiver).map(|point| vec![(point, 1.0)]);
    let all: Vec<Option<Weights>> = receivers.par_iter().with_min_len(256).map(weights).collect();
    Interpolation::new(all)
}
