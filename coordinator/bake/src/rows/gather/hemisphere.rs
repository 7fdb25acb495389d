//! What receivers see of shares, by rays.

use glam::DVec3;
use kernel::replica::{Receiver, Receivers, ScenePolygons};
use kernel::row::{Hemisphere, Shape, Shooter};

use crate::error::Result;
use crate::jobs::{ReceiverSet, RowClient};
use crate::mesh::Mesh;
use scene::Scene;

/// The shares that a receiver sees, by rising index, with their form factors.
pub type View = Box<[(u32, f32)]>;

/// Irradiance from what is seen, where shares have this radiosity.
pub fn gathered(view: &[(u32, f32)], radiosity: &[DVec3]) -> DVec3 {
    view.iter().map(|(share, factor)| radiosity[*share as usize] * f64::from(*factor)).sum()
}

/// Part of a hemisphere that is covered.
pub fn covered(view: &[(u32, f32)]) -> f64 {
    view.iter().map(|(_, factor)| f64::from(*factor)).sum()
}

/// Leaves of a mesh as rays see them, each with its opacity where one is not opaque.
pub fn leaf_polygons(scene: &Scene, mesh: &Mesh) -> ScenePolygons {
    let mut leaves = ScenePolygons::default();
    for (id, patch) in mesh.leaves() {
        let surface = &scene.surfaces[patch.surface as usize];
        let polygon = mesh.polygon(scene, id);
        let is_solid = surface.opacity >= 1.0;
        let opacity = if is_solid { 1.0 } else { surface.mean_opacity(patch.facet, &polygon.corners) };
        leaves.polygons.push(polygon);
        leaves.opacities.push(opacity.clamp(0.0, 1.0) as f32);
    }
    if leaves.opacities.iter().all(|opacity| *opacity == 1.0) {
        leaves.opacities.clear();
    }
    leaves
}

/// What each receiver sees of published polygons, by its number of rays.
pub fn views(
    client: &mut RowClient,
    polygons: ReceiverSet,
    receivers: &Receivers,
    rays: impl Fn(usize) -> u32,
) -> Result<Vec<View>> {
    let most = (0..receivers.receivers.len()).map(&rays).max().unwrap_or(1);
    let hemisphere = |(index, receiver): (usize, &Receiver)| {
        let rays = rays(index).clamp(1, Hemisphere::MOST_RAYS);
        let shape = Shape::Hemisphere(Hemisphere { receiver: *receiver, rays });
        Shooter { key: receivers.first_key + index as u64, shape }
    };
    let shooters: Vec<Shooter> = receivers.receivers.iter().enumerate().map(hemisphere).collect();
    let mut views = Vec::with_capacity(shooters.len());
    client.each_row(&shooters, polygons.seen_by(most), |_, row, _| {
        views.push(row.iter().map(|(share, factor)| (share as u32, factor)).collect::<View>());
    })?;
    Ok(views)
}
