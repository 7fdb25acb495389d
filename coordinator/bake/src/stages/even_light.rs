//! Where light is so even that the mean of points around another is its light.
//!
//! Points alone do not tell: what is smaller than their distance may lie between them. But the mesh was divided where light changes, so
//! that the light between its vertices tells whether something does.

use glam::{DVec3, Vec3};
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::hemisphere::SeenPolygons;
use kernel::replica::Receiver;
use rayon::prelude::*;

use super::layers::Layer;
use super::solved::Solved;
use crate::context::Context;
use crate::error::Result;
use crate::mesh::{Interpolation, PatchId, interpolation};

/// Points looked at between checks for cancellation.
const AT_ONCE: usize = 1 << 15;

/// Height from which the mesh is looked for below a point, and how far below it may be, in frame units: points over curved surfaces
/// are lifted.
const ABOVE: f64 = 0.01;
const BELOW: f64 = 2.0;

/// Least cosine between the normals of a point and of the leaf below it, where they are not in one plane.
const LEAST_COSINE: f64 = 0.9;

/// Limits in parts of the error asked for, relative to the light: of differences among the points around another, of what of them the
/// mesh does not have, of the difference of the means of opposite points, and of that of the mesh's light at the point from its mean
/// around.
const MOST_RANGE: f64 = 3.0;
const MOST_UNKNOWN: f64 = 1.5;
const MOST_TWIST: f64 = 1.0;
const MOST_BEND: f64 = 0.5;

/// Part of the median light of the mesh below which differences are not looked at.
const DARK: f64 = 0.02;

/// What the mesh knows of light at points.
pub struct EvenLight<'a> {
    /// For each point that lies between others, four of them.
    around: &'a [Option<[u32; 4]>],
    /// The part of the light that is wanted, then each group's.
    layers: Vec<MeshLight>,
    /// The error asked for.
    error: f64,
}

/// Irradiance of a layer as the mesh has it.
struct MeshLight {
    /// At each point; not a number where there is no leaf.
    at: Vec<Vec3>,
    /// Differences are relative to this light at least.
    floor: f64,
}

impl<'a> EvenLight<'a> {
    /// Looks these points up, which lie between others as [`super::AskedPoints::around`] has it.
    pub fn new(
        solved: &Solved,
        cx: &mut Context,
        (points, around): (&[Receiver], &'a [Option<[u32; 4]>]),
        layers: &[Layer],
    ) -> Result<Self> {
        let mesh = &solved.mesh.mesh;
        let leaves: Vec<PatchId> = mesh.leaves().map(|(id, _)| id).collect();
        let polygons: Vec<ConvexPolygon> =
            leaves.par_iter().with_min_len(1024).map(|leaf| mesh.polygon(cx.scene, *leaf)).collect();
        let seen = SeenPolygons::new(&polygons, &[]);
        let all = &solved.solution.irradiance;
        let below = |point: &Receiver| {
            let above = point.position + point.normal * ABOVE;
            let hit = seen.nearest(above, -point.normal, 0.0, PlaneId::NONE)?;
            let cosine = || polygons[hit.polygon].normal().dot(point.normal);
            let is_own = hit.plane == point.plane || cosine() >= LEAST_COSINE;
            if !hit.is_front || !is_own || hit.distance > ABOVE + BELOW {
                return None;
            }
            let place = above - point.normal * hit.distance;
            Some(interpolation(mesh, leaves[hit.polygon], place, |vertex| all[vertex.index()]))
        };
        let wanted = cx.settings.only.of_all(all, &solved.direct);
        let values: Vec<&[DVec3]> =
            [&*wanted].into_iter().chain(layers.iter().map(|layer| &*layer.lit.irradiance)).collect();
        let mut light: Vec<Vec<Vec3>> = values.iter().map(|_| Vec::with_capacity(points.len())).collect();
        for some in points.chunks(AT_ONCE) {
            cx.client.monitor.check()?;
            let found: Vec<Option<Interpolation>> = some.par_iter().with_min_len(256).map(below).collect();
            for (light, values) in light.iter_mut().zip(&values) {
                let value = |weights: &Interpolation| {
                    weights.iter().map(|(vertex, weight)| values[vertex.index()] * *weight).sum::<DVec3>()
                };
                light.extend(found.iter().map(|of| of.as_ref().map_or(Vec3::NAN, |of| value(of).as_vec3())));
            }
        }
        let layers = light.into_iter().map(|at| MeshLight { floor: DARK * median(&at), at }).collect();
        Ok(Self { around, layers, error: cx.settings.asked_error() })
    }

    /// Gives those of these points where light is even the mean of the points around, layer by layer; returns all others.
    pub fn take_means(
        &self,
        cx: &mut Context,
        points: &[usize],
        light: &mut [Vec<DVec3>],
    ) -> Result<Vec<usize>> {
        let mut others = vec![];
        for some in points.chunks(AT_ONCE) {
            cx.client.monitor.check()?;
            let mean = |point: &usize| self.mean(*point, light);
            let means: Vec<Option<Vec<DVec3>>> = some.par_iter().with_min_len(1024).map(mean).collect();
            for (point, mean) in some.iter().zip(means) {
                match mean {
                    Some(mean) => light.iter_mut().zip(mean).for_each(|(light, mean)| light[*point] = mean),
                    None => others.push(*point),
                }
            }
        }
        Ok(others)
    }

    /// The mean of the points around another in each layer, where all layers are even.
    fn mean(&self, point: usize, light: &[Vec<DVec3>]) -> Option<Vec<DVec3>> {
        let around = self.around.get(point).copied().flatten()?.map(|other| other as usize);
        let mean = |(light, mesh): (&Vec<DVec3>, &MeshLight)| {
            let (found, known) = (around.map(|other| light[other]), around.map(|other| mesh.light(other)));
            let mean = mean_of(found);
            let allowed = self.error * mean.max_element().max(mesh.floor);
            let [a, b, c, d] = found;
            let twist = (a + b - c - d).abs().max_element() / 2.0;
            let unknown = range([0, 1, 2, 3].map(|other| found[other] - known[other]));
            let bend = (mesh.light(point) - mean_of(known)).abs().max_element();
            // Where one of them is not a number, neither is the bend, and no comparison with it holds.
            let is_even = range(found) <= MOST_RANGE * allowed
                && unknown <= MOST_UNKNOWN * allowed
                && twist <= MOST_TWIST * allowed
                && bend <= MOST_BEND * allowed;
            is_even.then_some(mean)
        };
        light.iter().zip(&self.layers).map(mean).collect()
    }
}

impl MeshLight {
    fn light(&self, point: usize) -> DVec3 {
        self.at[point].as_dvec3()
    }
}

fn mean_of(light: [DVec3; 4]) -> DVec3 {
    light.into_iter().sum::<DVec3>() / 4.0
}

/// Largest difference in a channel.
fn range([a, b, c, d]: [DVec3; 4]) -> f64 {
    (a.max(b).max(c).max(d) - a.min(b).min(c).min(d)).max_element()
}

/// Median of the largest channel of what is known.
fn median(light: &[Vec3]) -> f64 {
    let mut known: Vec<f32> =
        light.iter().filter(|light| !light.is_nan()).map(|light| light.max_element()).collect();
    let middle = known.len() / 2;
    if known.is_empty() { 0.0 } else { f64::from(*known.select_nth_unstable_by(middle, f32::total_cmp).1) }
}
