//! Surfaces whose emission is a picture, as polygons of one exitance each.
//!
//! Each facet gives the patches of the shooting mesh; what divides it into parts that emit alike is taken back.

use std::collections::BTreeMap;

use glam::DVec3;
use kernel::geometry::{Bounds, ConvexPolygon};
use rayon::prelude::*;

use crate::mesh::{Mesh, PatchId};
use scene::{Scene, Surface};

/// Exitances that differ by less than this part of the larger one are equal.
const EQUAL: f64 = 1e-6;

/// The same where emitters are joined, as a part of the error asked and of their surface's largest exitance: their light is then
/// sampled, and of fewer polygons.
const ALIKE: f64 = 0.25;

/// Facets that a thread takes at a time.
const FACETS_AT_ONCE: usize = 64;

/// Whether a surface does not emit alike everywhere.
fn is_picture(surface: &Surface) -> bool {
    surface.exitance != DVec3::ZERO && surface.appearance.as_ref().is_some_and(|own| !own.emits_evenly())
}

/// The polygons of the surfaces that emit pictures, with their exitances, by the index of the surface. The mesh is that of the shares.
///
/// Where emitters are joined, `joined` is the error asked, and a number of polygons: parts are taken together until no more shine, or each
/// facet is one. Those are first that differ by the least flux: what is small is seen as a whole from nearly everywhere.
pub fn pictures(
    scene: &Scene,
    mesh: &Mesh,
    joined: Option<(f64, usize)>,
) -> BTreeMap<usize, Vec<(ConvexPolygon, DVec3)>> {
    let mut patches: BTreeMap<(u32, u32), Vec<PatchId>> = BTreeMap::new();
    for (index, patch) in mesh.patches.iter().enumerate() {
        if patch.parent.is_none() && is_picture(&scene.surfaces[patch.surface as usize]) {
            patches.entry((patch.surface, patch.facet)).or_default().push(PatchId(index as u32));
        }
    }
    let mut pictures: BTreeMap<usize, Vec<Part>> = BTreeMap::new();
    for (index, surface) in scene.surfaces.iter().enumerate().filter(|(_, surface)| is_picture(surface)) {
        let facet = |facet: usize| {
            let own = patches.get(&(index as u32, facet as u32)).map_or(&[][..], Vec::as_slice);
            let own = own.iter().map(|patch| Part::new(scene, mesh, *patch)).collect();
            Part::of_parts(surface.facets[facet].polygon(), own)
        };
        let facets: Vec<Part> = (0..surface.facets.len()).into_par_iter().map(facet).collect();
        let largest = facets.iter().map(Part::largest).fold(0.0, f64::max);
        let exitance = joined.map_or(0.0, |(error, _)| ALIKE * error * largest);
        pictures.insert(index, merged(facets, Alike { exitance, flux: 0.0 }));
    }
    let flux = joined.map_or(0.0, |(_, most)| flux_to_merge(pictures.values().flatten(), most));
    if flux > 0.0 {
        for facets in pictures.values_mut() {
            *facets = merged(std::mem::take(facets), Alike { exitance: 0.0, flux });
        }
    }
    let polygons = |facets: Vec<Part>| facets.into_iter().flat_map(Part::into_polygons).collect();
    pictures.into_iter().map(|(surface, facets)| (surface, polygons(facets))).collect()
}

/// Parts count as one where their exitances differ by no more than either of these.
#[derive(Clone, Copy)]
struct Alike {
    /// A difference of exitances.
    exitance: f64,
    /// A difference of exitances times the area of all parts.
    flux: f64,
}

/// A facet or a part of it, with what it emits.
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
    /// A patch.
    fn new(scene: &Scene, mesh: &Mesh, id: PatchId) -> Self {
        let patch = mesh.patch(id);
        let polygon = mesh.polygon(scene, id);
        if patch.first_child.is_some() {
            return Self::of_parts(
                polygon,
                mesh.children(id).map(|child| Self::new(scene, mesh, child)).collect(),
            );
        }
        let surface = &scene.surfaces[patch.surface as usize];
        let emits = Emits::Evenly(surface.mean_exitance(patch.facet, &polygon.corners));
        Self { polygon, area: patch.area, emits }
    }

    fn of_parts(polygon: ConvexPolygon, parts: Vec<Self>) -> Self {
        let area = parts.iter().map(|part| part.area).sum();
        Self { polygon, area, emits: Emits::InParts(parts) }
    }

    /// The largest exitance in any channel.
    fn largest(&self) -> f64 {
        match &self.emits {
            Emits::Evenly(exitance) => exitance.max_element(),
            Emits::InParts(parts) => parts.iter().map(Self::largest).fold(0.0, f64::max),
        }
    }

    /// The same, with parts that emit alike taken together.
    fn merged(self, alike: Alike) -> Self {
        let Emits::InParts(parts) = self.emits else { return self };
        let parts: Vec<Self> = parts.into_iter().map(|part| part.merged(alike)).collect();
        let emits = together(&parts, alike).map_or(Emits::InParts(parts), Emits::Evenly);
        Self { emits, ..self }
    }

    /// Its mean exitance, and the least [`Alike::flux`] with which all of it counts as one. Adds to `merges` that flux of each part that
    /// has parts, with the number of shining polygons that it saves: none needs less than its own parts do.
    fn merges(&self, merges: &mut Vec<(f64, usize)>) -> (DVec3, f64) {
        let parts = match &self.emits {
            Emits::Evenly(exitance) => return (*exitance, 0.0),
            Emits::InParts(parts) => parts,
        };
        let of_parts: Vec<(DVec3, f64)> = parts.iter().map(|part| part.merges(merges)).collect();
        let of_all = difference(of_parts.iter().map(|(exitance, _)| exitance)) * self.area;
        let flux = of_parts.iter().map(|(_, own)| *own).fold(of_all, f64::max).max(0.0);
        let shining = of_parts.iter().filter(|(exitance, _)| *exitance != DVec3::ZERO).count();
        merges.push((flux, shining.saturating_sub(1)));
        let emitted: DVec3 =
            parts.iter().zip(&of_parts).map(|(part, (exitance, _))| part.area * *exitance).sum();
        (if self.area > 0.0 { emitted / self.area } else { DVec3::ZERO }, flux)
    }

    /// Number of polygons that shine.
    fn count(&self) -> usize {
        match &self.emits {
            Emits::Evenly(exitance) => usize::from(*exitance != DVec3::ZERO),
            Emits::InParts(parts) => parts.iter().map(Self::count).sum(),
        }
    }

    fn into_polygons(self) -> Vec<(ConvexPolygon, DVec3)> {
        match self.emits {
            Emits::Evenly(exitance) => vec![(self.polygon, exitance)],
            Emits::InParts(parts) => parts.into_iter().flat_map(Self::into_polygons).collect(),
        }
    }
}

fn merged(facets: Vec<Part>, alike: Alike) -> Vec<Part> {
    facets.into_par_iter().with_min_len(FACETS_AT_ONCE).map(|facet| facet.merged(alike)).collect()
}

/// The least [`Alike::flux`] with which no more than `most` polygons shine, or all facets are one.
fn flux_to_merge<'a>(facets: impl Iterator<Item = &'a Part>, most: usize) -> f64 {
    let (mut merges, mut count) = (vec![], 0);
    for facet in facets {
        facet.merges(&mut merges);
        count += facet.count();
    }
    merges.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut flux = 0.0;
    for (own, saved) in merges {
        if count <= most {
            break;
        }
        flux = own;
        count -= saved;
    }
    flux
}

/// Mean exitance of parts that emit alike; `None` where they differ, or have no area.
fn together(parts: &[Part], alike: Alike) -> Option<DVec3> {
    let even = |part: &Part| match part.emits {
        Emits::Evenly(exitance) => Some(exitance),
        Emits::InParts(_) => None,
    };
    let exitances: Vec<DVec3> = parts.iter().map(even).collect::<Option<_>>()?;
    let largest = exitances.iter().map(|exitance| exitance.max_element()).fold(0.0, f64::max);
    let area: f64 = parts.iter().map(|part| part.area).sum();
    let flux: DVec3 = parts.iter().zip(&exitances).map(|(part, exitance)| part.area * *exitance).sum();
    let difference = difference(&exitances);
    let is_one = difference <= alike.exitance.max(EQUAL * largest) || difference * area <= alike.flux;
    (is_one && area > 0.0).then(|| flux / area)
}

/// Largest difference of exitances in any channel.
fn difference<'a>(exitances: impl IntoIterator<Item = &'a DVec3>) -> f64 {
    Bounds::around(exitances).extent().max_element()
}

#[cfg(test)]
mod tests {
    use kernel::geometry::PlaneId;
    use sobol_burley::sample_4d;

    use super::*;

    /// A square of this edge.
    fn square(edge: f64) -> ConvexPolygon {
        let corners =
            [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y].map(|corner| corner * edge);
        ConvexPolygon { plane: PlaneId(0), corners: corners.to_vec() }
    }

    /// A picture of 4^levels squares, every third of them bright, in a facet of this edge.
    fn picture(edge: f64, levels: u32, place: &mut u32) -> Part {
        if levels == 0 {
            *place += 1;
            let exitance = if place.is_multiple_of(3) { DVec3::new(1.0, 0.5, 0.1) } else { DVec3::ZERO };
            return Part { polygon: square(edge), area: edge * edge, emits: Emits::Evenly(exitance) };
        }
        let parts = (0..4).map(|_| picture(edge / 2.0, levels - 1, place)).collect();
        Part::of_parts(square(edge), parts)
    }

    fn flux(parts: &[Part]) -> DVec3 {
        let of = |part: &Part| match &part.emits {
            Emits::Evenly(exitance) => *exitance * part.area,
            Emits::InParts(parts) => flux(parts),
        };
        parts.iter().map(of).sum()
    }

    fn count(parts: &[Part]) -> usize {
        parts.iter().map(Part::count).sum()
    }

    #[test]
    fn a_noisy_picture_keeps_as_many_polygons_as_it_may() {
        // Square by square, as noise is, the least and largest values are far from the means.
        fn noisy(edge: f64, levels: u32, place: &mut u32) -> Part {
            if levels == 0 {
                *place += 1;
                let exitance = DVec3::splat(f64::from(sample_4d(0, 0, *place)[0]) + 0.1);
                return Part { polygon: square(edge), area: edge * edge, emits: Emits::Evenly(exitance) };
            }
            Part::of_parts(square(edge), (0..4).map(|_| noisy(edge / 2.0, levels - 1, place)).collect())
        }
        let facets = vec![noisy(1.0, 6, &mut 0)];
        let wanted = flux(&facets);
        for most in [2000, 500, 100] {
            let limit = flux_to_merge(facets.iter(), most);
            let joined = merged(vec![noisy(1.0, 6, &mut 0)], Alike { exitance: 0.0, flux: limit });
            assert!((most * 9 / 10..=most).contains(&count(&joined)), "{most}: {}", count(&joined));
            assert!((flux(&joined) - wanted).abs().max_element() < 1e-9 * wanted.x);
        }
    }

    #[test]
    fn of_many_pictures_the_smallest_become_one_colour_and_keep_their_flux() {
        // A screen, and a hundred small labels.
        let pictures = || -> Vec<Part> {
            let labels = (0..100).map(|index| picture(0.02, 3, &mut (index * 5)));
            std::iter::once(picture(2.0, 4, &mut 0)).chain(labels).collect()
        };
        let of_screen = picture(2.0, 4, &mut 0).count();
        let wanted = flux(&pictures());
        assert_eq!(flux_to_merge(pictures().iter(), count(&pictures())), 0.0);
        for most in [1000, of_screen + 100, of_screen, 40, 1] {
            let limit = flux_to_merge(pictures().iter(), most);
            let joined = merged(pictures(), Alike { exitance: 0.0, flux: limit });
            // The last ones that are alike go together, and each facet stays.
            let least = if most == 1000 { of_screen + 100 } else { most.min(101) };
            assert!((least..=most.max(101)).contains(&count(&joined)), "{most}: {}", count(&joined));
            assert!((flux(&joined) - wanted).abs().max_element() < 1e-12);
            assert_eq!(joined[0].count() == of_screen, most >= of_screen + 100, "{most}");
        }
    }
}
