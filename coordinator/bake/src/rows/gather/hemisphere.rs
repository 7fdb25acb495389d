//! What receivers see of shares, by rays.

use glam::DVec3;
use kernel::replica::{Receiver, Receivers, ScenePolygons};
use kernel::row::{Hemisphere, Shape, Shooter};
use rayon::prelude::*;

use crate::context::Context;
use crate::error::Result;
use crate::jobs::{ReceiverSet, RowClient};
use crate::materials::AveragedMaterial;
use crate::mesh::{Mesh, Patch, PatchId};
use scene::Scene;

/// What a receiver sees.
pub struct View {
    /// Shares, by rising index, with their form factors.
    shares: Box<[(u32, f32)]>,
    /// Sky view factor: the part of the hemisphere in which there is nothing.
    pub sky: f32,
}

/// Irradiance from what is seen, where shares have this radiosity.
pub fn gathered(view: &View, radiosity: &[DVec3]) -> DVec3 {
    view.shares.iter().map(|(share, factor)| radiosity[*share as usize] * f64::from(*factor)).sum()
}

/// Part of a hemisphere that is covered, where shares have these materials.
pub fn covered(view: &View, materials: &[AveragedMaterial]) -> f64 {
    view.shares.iter().map(|(share, factor)| f64::from(*factor) * materials[*share as usize].opacity).sum()
}

/// Publishes the leaves of a mesh, which rays meet.
pub fn publish_leaves(cx: &mut Context, mesh: &Mesh) -> ReceiverSet {
    let ScenePolygons { polygons, opacities } = leaf_polygons(cx.scene, mesh);
    cx.client.publish_polygons(&polygons, &opacities)
}

/// Leaves of a mesh as rays see them, each with its opacity where one is not opaque.
fn leaf_polygons(scene: &Scene, mesh: &Mesh) -> ScenePolygons {
    let all: Vec<_> = mesh.leaves().collect();
    let leaf = |(id, patch): &(PatchId, &Patch)| {
        let surface = &scene.surfaces[patch.surface as usize];
        let polygon = mesh.polygon(scene, *id);
        let is_solid = surface.opacity >= 1.0;
        let opacity = if is_solid { 1.0 } else { surface.mean_opacity(patch.facet, &polygon.corners) };
        (polygon, opacity.clamp(0.0, 1.0) as f32)
    };
    let (polygons, opacities) = all.par_iter().map(leaf).unzip();
    let mut leaves = ScenePolygons { polygons, opacities };
    if leaves.opacities.iter().all(|opacity| *opacity == 1.0) {
        leaves.opacities.clear();
    }
    leaves
}

/// The hemispheres of receivers, given the number of rays of each.
pub fn hemispheres(receivers: &Receivers, rays: impl Fn(usize) -> u32) -> Vec<Shooter> {
    let hemisphere = |(index, receiver): (usize, &Receiver)| {
        let rays = rays(index).clamp(1, Hemisphere::MOST_RAYS);
        let shape = Shape::Hemisphere(Hemisphere { receiver: *receiver, rays });
        Shooter { key: receivers.first_key + index as u64, shape }
    };
    receivers.receivers.iter().enumerate().map(hemisphere).collect()
}

/// What each hemisphere sees of published polygons.
pub fn views(client: &mut RowClient, polygons: ReceiverSet, hemispheres: &[Shooter]) -> Result<Vec<View>> {
    let rays = |shooter: &Shooter| match &shooter.shape {
        Shape::Hemisphere(hemisphere) => hemisphere.rays,
        _ => 1,
    };
    let most = hemispheres.iter().map(rays).max().unwrap_or(1);
    // After all polygons.
    let sky = polygons.count() as u32 - 1;
    let mut views = Vec::with_capacity(hemispheres.len());
    client.each_row(hemispheres, &[polygons.seen_by(most)], |_, _, row, _| {
        let mut seen: Vec<(u32, f32)> = row.iter().map(|(index, factor)| (index as u32, factor)).collect();
        let sky = seen.pop_if(|(index, _)| *index == sky).map_or(0.0, |(_, factor)| factor);
        views.push(View { shares: seen.into(), sky });
    })?;
    Ok(views)
}
