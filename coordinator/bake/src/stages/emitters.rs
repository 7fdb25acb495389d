//! The emitting surfaces as polygons of one exitance each.
//!
//! A surface that emits evenly gives its facets. One whose emission is a picture gives the patches of the shooting mesh, each with its
//! mean; the black ones are left out, and what divides a facet or patch into parts of equal exitance is taken back.

use std::collections::BTreeMap;

use glam::DVec3;
use kernel::geometry::ConvexPolygon;

use crate::mesh::{Mesh, PatchId};
use scene::{Scene, Surface};

/// Exitances that differ by less than this part of the surface's largest are equal.
const EQUAL: f64 = 1e-6;

/// A polygon that emits.
pub struct Emitter {
    /// Index of its surface.
    pub surface: usize,
    /// Where it lies.
    pub polygon: ConvexPolygon,
    /// What it emits, in the mean.
    pub exitance: DVec3,
}

/// The emitting polygons of a scene, surface by surface. The mesh is that of the shares.
pub fn emitters(scene: &Scene, mesh: &Mesh) -> Vec<Emitter> {
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
        for (facet_index, facet) in surface.facets.iter().enumerate() {
            if is_even(surface) {
                emitters.push(Emitter {
                    surface: index,
                    polygon: facet.polygon(),
                    exitance: surface.exitance,
                });
                continue;
            }
            let own = pieces.remove(&(index as u32, facet_index as u32)).unwrap_or_default();
            let parts: Vec<Part> = own.into_iter().map(|patch| Part::new(scene, mesh, patch)).collect();
            let polygons = match together(&parts) {
                Some((exitance, _)) => vec![(facet.polygon(), exitance)],
                None => parts.into_iter().flat_map(Part::into_polygons).collect(),
            };
            let shining = polygons.into_iter().filter(|(_, exitance)| *exitance != DVec3::ZERO);
            emitters.extend(shining.map(|(polygon, exitance)| Emitter { surface: index, polygon, exitance }));
        }
    }
    emitters
}

/// A patch with what it emits.
enum Part {
    /// All alike.
    One { polygon: ConvexPolygon, exitance: DVec3, area: f64 },
    /// In parts that differ.
    Many(Vec<Part>),
}

impl Part {
    fn new(scene: &Scene, mesh: &Mesh, id: PatchId) -> Self {
        let patch = mesh.patch(id);
        let polygon = mesh.polygon(scene, id);
        if patch.first_child.is_none() {
            let surface = &scene.surfaces[patch.surface as usize];
            let exitance = surface.mean_exitance(patch.facet, &polygon.corners);
            return Self::One { polygon, exitance, area: patch.area };
        }
        let parts: Vec<Self> = mesh.children(id).map(|child| Self::new(scene, mesh, child)).collect();
        match together(&parts) {
            Some((exitance, area)) => Self::One { polygon, exitance, area },
            None => Self::Many(parts),
        }
    }

    fn into_polygons(self) -> Vec<(ConvexPolygon, DVec3)> {
        match self {
            Self::One { polygon, exitance, .. } => vec![(polygon, exitance)],
            Self::Many(parts) => parts.into_iter().flat_map(Self::into_polygons).collect(),
        }
    }
}

/// Mean exitance and area of parts that emit alike; `None` where they differ.
fn together(parts: &[Part]) -> Option<(DVec3, f64)> {
    let (mut flux, mut all, mut range) = (DVec3::ZERO, 0.0, None);
    for part in parts {
        let Part::One { exitance, area, .. } = part else { return None };
        let (low, high) = range.unwrap_or((*exitance, *exitance));
        range = Some((exitance.min(low), exitance.max(high)));
        (flux, all) = (flux + *exitance * *area, all + area);
    }
    let (low, high) = range?;
    ((high - low).max_element() <= EQUAL * high.max_element()).then_some((flux / all, all))
}
