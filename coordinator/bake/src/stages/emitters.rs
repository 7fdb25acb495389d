//! The emitting surfaces as polygons of one exitance each.
//!
//! A surface that emits evenly gives its facets, one whose emission is a picture gives parts of them; the black ones are left out.

use glam::DVec3;
use kernel::geometry::ConvexPolygon;
use kernel::row::Shape;

use super::pictures::pictures;
use crate::mesh::Mesh;
use scene::Scene;

/// Most polygons of a joint light source: its row must fit a job.
pub const MOST_JOINED: usize = 4096;

/// A polygon that emits.
#[derive(Clone)]
pub struct Emitter {
    /// Index of its surface.
    pub surface: usize,
    /// Where it lies.
    pub polygon: ConvexPolygon,
    /// What it emits, in the mean.
    pub exitance: DVec3,
}

impl Emitter {
    /// The flux that leaves it.
    pub fn flux(&self) -> DVec3 {
        self.polygon.area() * self.exitance
    }
}

/// The emitting polygons of a scene, surface by surface. The mesh is that of the shares; `joined` is the error asked where emitters are
/// joined.
pub fn emitters(scene: &Scene, mesh: &Mesh, joined: Option<f64>) -> Vec<Emitter> {
    let mut pictures = pictures(scene, mesh, joined.map(|error| (error, MOST_JOINED)));
    let mut emitters = vec![];
    for (index, surface) in scene.surfaces.iter().enumerate().filter(|(_, s)| s.exitance != DVec3::ZERO) {
        let polygons: Vec<(ConvexPolygon, DVec3)> = match pictures.remove(&index) {
            Some(polygons) => polygons,
            None => surface.facets.iter().map(|facet| (facet.polygon(), surface.exitance)).collect(),
        };
        let shining = polygons.into_iter().filter(|(_, exitance)| *exitance != DVec3::ZERO);
        emitters.extend(shining.map(|(polygon, exitance)| Emitter { surface: index, polygon, exitance }));
    }
    emitters
}

/// Polygons of one colour as one shape: each is weighted by its exitance in the strongest channel. With the exitance that a weight of 1
/// stands for; `None` where all are dark.
pub fn weighted(polygons: impl Iterator<Item = (ConvexPolygon, DVec3)>) -> Option<(Shape, f64)> {
    let (lit, most) = lit(polygons)?;
    let weight = |(polygon, exitance): (_, DVec3)| (polygon, exitance.max_element() / most);
    Some((Shape::of_one_colour(lit.into_iter().map(weight)), most))
}

/// Polygons of many colours as a shape for each channel, a dark one too, with the exitance that a weight of 1 stands for; none where all are
/// dark. All channels have the same flux in weights, so that as many rays tell of each.
pub fn weighted_by_channel(polygons: impl Iterator<Item = (ConvexPolygon, DVec3)>) -> Vec<(Shape, DVec3)> {
    let Some((lit, _)) = lit(polygons) else { return vec![] };
    let flux: DVec3 = lit.iter().map(|(polygon, exitance)| polygon.area() * *exitance).sum();
    let part = |exitance: DVec3| DVec3::select(flux.cmpgt(DVec3::ZERO), exitance / flux, DVec3::ZERO);
    let most = lit.iter().map(|(_, exitance)| part(*exitance).max_element()).fold(0.0, f64::max);
    let weights = |(polygon, exitance): (_, DVec3)| (polygon, (part(exitance) / most).to_array());
    let shapes = Shape::of_colours(lit.into_iter().map(weights).collect());
    shapes.into_iter().zip(DVec3::AXES).map(|(shape, channel)| (shape, most * flux * channel)).collect()
}

/// Those that are not dark, and their largest exitance in any channel.
fn lit(polygons: impl Iterator<Item = (ConvexPolygon, DVec3)>) -> Option<(Vec<(ConvexPolygon, DVec3)>, f64)> {
    let lit: Vec<_> = polygons.filter(|(_, exitance)| exitance.max_element() > 0.0).collect();
    let most = lit.iter().map(|(_, exitance)| exitance.max_element()).fold(0.0, f64::max);
    (most > 0.0).then_some((lit, most))
}
