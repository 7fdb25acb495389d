//! The emitting surfaces as polygons of one exitance each.
//!
//! A surface that emits evenly gives its facets. One whose emission is a picture gives the patches of the shooting mesh, each with its
//! mean; the black ones are left out, and what divides a facet or patch into parts of equal exitance is taken back.

use std::collections::BTreeMap;

use glam::DVec3;
use kernel::geometry::ConvexPolygon;
use kernel::row::Shape;
use rayon::prelude::*;

use crate::mesh::{Mesh, PatchId};
use scene::{Facet, Scene, Surface};

/// Exitances that differ by less than this part of the larger one are equal.
const EQUAL: f64 = 1e-6;

/// The same where emitters are joined, as a part of the error asked and of their surface's largest exitance: their light is then
/// sampled, and of fewer polygons.
const ALIKE: f64 = 0.25;

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
    let is_even =
        |surface: &Surface| surface.appearance.as_ref().is_none_or(|appearance| appearance.emits_evenly());
    let mut pieces: BTreeMap<(u32, u32), Vec<PatchId>> = BTreeMap::new();
    for (index, patch) in mesh.patches.iter().enumerate() {
        let surface = &scene.surfaces[patch.surface as usize];
        if patch.parent.is_none() && surface.exitance != DVec3::ZERO && !is_even(surface) {
            pieces.entry((patch.surface, patch.facet)).or_default().push(PatchId(index as u32));
        }
    }
    let mut emitters = vec![];
    for (index, surface) in scene.surfaces.iter().enumerate().filter(|(_, s)| s.exitance != DVec3::ZERO) {
        if is_even(surface) {
            let polygons = surface.facets.iter().map(Facet::polygon);
            emitters.extend(polygons.map(|polygon| Emitter {
                surface: index,
                polygon,
                exitance: surface.exitance,
            }));
            continue;
        }
        // Each facet as a whole, and its patches.
        let facets: Vec<(ConvexPolygon, Vec<Part>)> = (0..surface.facets.len())
            .into_par_iter()
            .map(|facet| {
                let own = pieces.get(&(index as u32, facet as u32)).map_or(&[][..], Vec::as_slice);
                let parts = own.iter().map(|patch| Part::new(scene, mesh, *patch)).collect();
                (surface.facets[facet].polygon(), parts)
            })
            .collect();
        let largest = facets.iter().flat_map(|(_, parts)| parts).map(Part::largest).fold(0.0, f64::max);
        let alike = joined.map_or(0.0, |error| ALIKE * error * largest);
        let polygons: Vec<(ConvexPolygon, DVec3)> = facets
            .into_par_iter()
            .flat_map_iter(|(facet, parts)| {
                let parts: Vec<Part> = parts.into_iter().map(|part| part.merged(alike)).collect();
                match together(&parts, alike) {
                    Some((exitance, _)) => vec![(facet, exitance)],
                    None => parts.into_iter().flat_map(Part::into_polygons).collect(),
                }
            })
            .collect();
        let shining = polygons.into_iter().filter(|(_, exitance)| *exitance != DVec3::ZERO);
        emitters.extend(shining.map(|(polygon, exitance)| Emitter { surface: index, polygon, exitance }));
    }
    emitters
}

/// Polygons with their exitances as one shape: each is weighted by its exitance in a channel, or in the strongest of several. With the
/// exitance that a weight of 1 stands for; `None` where all are dark.
pub fn weighted(
    polygons: impl Iterator<Item = (ConvexPolygon, DVec3)>,
    channels: DVec3,
) -> Option<(Shape, f64)> {
    let strength = |(polygon, exitance): (_, DVec3)| (polygon, (exitance * channels).max_element());
    let mut lit: Vec<(ConvexPolygon, f64)> =
        polygons.map(strength).filter(|(_, strength)| *strength > 0.0).collect();
    let most = lit.iter().map(|(_, strength)| *strength).fold(0.0, f64::max);
    lit.iter_mut().for_each(|(_, weight)| *weight /= most);
    (most > 0.0).then_some((Shape::Weighted(lit), most))
}

/// A patch with what it emits.
struct Part {
    polygon: ConvexPolygon,
    area: f64,
    emits: Emits,
}

enum Emits {
    /// All alike.
    Evenly(DVec3),
    /// In parts that may differ.
    InParts(Vec<Part>),
}

impl Part {
    fn new(scene: &Scene, mesh: &Mesh, id: PatchId) -> Self {
        let patch = mesh.patch(id);
        let polygon = mesh.polygon(scene, id);
        let emits = if patch.first_child.is_none() {
            let surface = &scene.surfaces[patch.surface as usize];
            Emits::Evenly(surface.mean_exitance(patch.facet, &polygon.corners))
        } else {
            Emits::InParts(mesh.children(id).map(|child| Self::new(scene, mesh, child)).collect())
        };
        Self { polygon, area: patch.area, emits }
    }

    /// The largest exitance in any channel.
    fn largest(&self) -> f64 {
        match &self.emits {
            Emits::Evenly(exitance) => exitance.max_element(),
            Emits::InParts(parts) => parts.iter().map(Self::largest).fold(0.0, f64::max),
        }
    }

    /// The same, with parts that emit alike taken together.
    fn merged(self, alike: f64) -> Self {
        let Emits::InParts(parts) = self.emits else { return self };
        let parts: Vec<Self> = parts.into_iter().map(|part| part.merged(alike)).collect();
        match together(&parts, alike) {
            Some((exitance, area)) => Self { area, emits: Emits::Evenly(exitance), ..self },
            None => Self { emits: Emits::InParts(parts), ..self },
        }
    }

    fn into_polygons(self) -> Vec<(ConvexPolygon, DVec3)> {
        match self.emits {
            Emits::Evenly(exitance) => vec![(self.polygon, exitance)],
            Emits::InParts(parts) => parts.into_iter().flat_map(Self::into_polygons).collect(),
        }
    }
}

/// Mean exitance and area of parts that emit alike, within this difference; `None` where they differ.
fn together(parts: &[Part], alike: f64) -> Option<(DVec3, f64)> {
    let (mut flux, mut all, mut range) = (DVec3::ZERO, 0.0, None);
    for Part { area, emits, .. } in parts {
        let Emits::Evenly(exitance) = emits else { return None };
        let (low, high) = range.unwrap_or((*exitance, *exitance));
        range = Some((exitance.min(low), exitance.max(high)));
        (flux, all) = (flux + *exitance * *area, all + area);
    }
    let (low, high) = range?;
    ((high - low).max_element() <= alike.max(EQUAL * high.max_element())).then_some((flux / all, all))
}
