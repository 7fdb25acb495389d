//! Where light is so even that the mean of points around another is its light.
//!
//! Points alone do not tell: what is smaller than their distance may lie between them. But the mesh was divided where light changes,
//! so that light between its vertices, wherever they are, tells whether something does.

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::hemisphere::SeenPolygons;
use kernel::replica::Receiver;
use rayon::prelude::*;

use super::solved::Solved;
use crate::context::Context;
use crate::error::Result;
use crate::mesh::{PatchId, VertexId, interpolation};

/// Points looked up between two questions whether the bake is cancelled.
const AT_ONCE: usize = 1 << 15;

/// Height from which the mesh is looked for below a point, and how far below it may be, in frame units: points over curved surfaces
/// are lifted.
const ABOVE: f64 = 0.01;
const BELOW: f64 = 2.0;

/// No plane of the scene.
const NO_PLANE: PlaneId = PlaneId(u32::MAX);

/// Most difference of the points around another, of the means of opposite ones, and of the light that the mesh has there from what it
/// has around: in parts of the error asked for, relative to the light.
const MOST_RANGE: f64 = 3.0;
const MOST_TWIST: f64 = 1.0;
const MOST_BEND: f64 = 0.5;

/// Part of the mean light below which differences are not looked at.
pub const DARK: f64 = 0.02;

/// What the mesh knows of light at points.
pub struct EvenLight<'a> {
    /// For each point that lies between others, four of them.
    around: &'a [Option<[u32; 4]>],
    /// Irradiance by the mesh; none where it has no leaf.
    by_mesh: Vec<Option<DVec3>>,
    /// The error asked for.
    error: f64,
    /// Differences of the light of the mesh are relative to this light at least.
    floor: f64,
}

impl<'a> EvenLight<'a> {
    /// Looks these points up, which lie between others as [`super::AskedPoints::around`] has it.
    pub fn new(
        solved: &Solved,
        cx: &mut Context,
        points: &[Receiver],
        around: &'a [Option<[u32; 4]>],
    ) -> Result<Self> {
        let mesh = &solved.mesh.mesh;
        let leaves: Vec<PatchId> = mesh.leaves().map(|(id, _)| id).collect();
        let polygons: Vec<ConvexPolygon> =
            leaves.par_iter().with_min_len(1024).map(|leaf| mesh.polygon(cx.scene, *leaf)).collect();
        let seen = SeenPolygons::new(&polygons, &[]);
        let all = &solved.solution.irradiance;
        let irradiance = |vertex: VertexId| all[vertex.index()];
        let at = |point: &Receiver| {
            let above = point.position + point.normal * ABOVE;
            let hit = seen.nearest(above, -point.normal, 0.0, NO_PLANE)?;
            if !hit.is_front || hit.distance > ABOVE + BELOW {
                return None;
            }
            let place = above - point.normal * hit.distance;
            let weights = interpolation(mesh, leaves[hit.polygon], place, irradiance);
            Some(weights.into_iter().map(|(vertex, weight)| irradiance(vertex) * weight).sum())
        };
        let mut by_mesh: Vec<Option<DVec3>> = Vec::with_capacity(points.len());
        for some in points.chunks(AT_ONCE) {
            cx.client.monitor.check()?;
            by_mesh.par_extend(some.par_iter().with_min_len(256).map(at));
        }
        let known = by_mesh.iter().flatten().map(|light| light.max_element());
        let floor = DARK * known.sum::<f64>() / by_mesh.len().max(1) as f64;
        Ok(Self { around, by_mesh, error: cx.settings.asked_error(), floor })
    }

    /// Gives those of these points where light is even the mean of the points around, layer by layer; returns all others. Differences in
    /// a layer are relative to its floor at least.
    pub fn take_means(&self, points: &[usize], light: &mut [Vec<DVec3>], floors: &[f64]) -> Vec<usize> {
        let mean = |point: &usize| self.mean(*point, light, floors);
        let means: Vec<Option<Vec<DVec3>>> = points.par_iter().with_min_len(1024).map(mean).collect();
        let mut others = vec![];
        for (point, mean) in points.iter().zip(means) {
            match mean {
                Some(mean) => light.iter_mut().zip(mean).for_each(|(light, mean)| light[*point] = mean),
                None => others.push(*point),
            }
        }
        others
    }

    fn mean(&self, point: usize, light: &[Vec<DVec3>], floors: &[f64]) -> Option<Vec<DVec3>> {
        let around = self.around.get(point).copied().flatten()?.map(|other| other as usize);
        let [a, b, c, d] = around.map(|other| self.by_mesh[other]);
        let by_mesh = (a? + b? + c? + d?) / 4.0;
        let bend = (self.by_mesh[point]? - by_mesh).abs().max_element();
        if bend > MOST_BEND * self.error * by_mesh.max_element().max(self.floor) {
            return None;
        }
        let mean = |(light, floor): (&Vec<DVec3>, &f64)| {
            let [a, b, c, d] = around.map(|other| light[other]);
            let mean = (a + b + c + d) / 4.0;
            let allowed = self.error * mean.max_element().max(*floor);
            let range = a.max(b).max(c).max(d) - a.min(b).min(c).min(d);
            let twist = (a + b - c - d).abs() / 2.0;
            (range.max_element() <= MOST_RANGE * allowed && twist.max_element() <= MOST_TWIST * allowed)
                .then_some(mean)
        };
        light.iter().zip(floors).map(mean).collect()
    }
}
