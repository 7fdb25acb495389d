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
use scene::{Scene, Surface};

/// Exitances that differ by less than this part of the larger one are equal.
const EQUAL: f64 = 1e-6;

/// The same where emitters are joined, as a part of the error asked and of their surface's largest exitance: their light is then
/// sampled, and of fewer polygons.
const ALIKE: f64 = 0.25;

/// Most polygons of a joint light source: its row must fit a job. Where emitters are joined, parts of pictures that emit are taken together
/// until no more are left, or each facet is one; those first that differ by the least flux: what is small is seen as a whole from nearly
/// everywhere.
pub const MOST_JOINED: usize = 4096;

/// Facets that a thread takes at a time.
const FACETS_AT_ONCE: usize = 64;

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
    let mut pictures: BTreeMap<usize, Vec<Part>> = BTreeMap::new();
    for (index, surface) in scene.surfaces.iter().enumerate() {
        if surface.exitance != DVec3::ZERO && !is_even(surface) {
            let of_facet =
                |facet: usize| pieces.get(&(index as u32, facet as u32)).map_or(&[][..], Vec::as_slice);
            let facets = (0..surface.facets.len()).into_par_iter();
            let parts = facets.map(|facet| {
                let own = of_facet(facet).iter().map(|patch| Part::new(scene, mesh, *patch));
                Part::of_parts(surface.facets[facet].polygon(), own.collect())
            });
            let parts: Vec<Part> = parts.collect();
            let largest = parts.iter().map(Part::largest).fold(0.0, f64::max);
            let alike = Alike { exitance: joined.map_or(0.0, |error| ALIKE * error * largest), flux: 0.0 };
            pictures.insert(index, merged(parts, alike));
        }
    }
    let flux = flux_to_merge(pictures.values().flatten(), MOST_JOINED);
    if joined.is_some() && flux > 0.0 {
        pictures.values_mut().for_each(|parts| {
            *parts = merged(std::mem::take(parts), Alike { exitance: 0.0, flux });
        });
    }
    let mut emitters = vec![];
    for (index, surface) in scene.surfaces.iter().enumerate().filter(|(_, s)| s.exitance != DVec3::ZERO) {
        let polygons: Vec<(ConvexPolygon, DVec3)> = match pictures.remove(&index) {
            Some(parts) => parts.into_iter().flat_map(Part::into_polygons).collect(),
            None => surface.facets.iter().map(|facet| (facet.polygon(), surface.exitance)).collect(),
        };
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

/// Which parts count as one.
#[derive(Clone, Copy)]
struct Alike {
    /// Those with exitances that differ by no more.
    exitance: f64,
    /// Those with exitances of which the difference, times all of their area, is no more.
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
        let (mut emitted, mut range, mut flux, mut shining) = (DVec3::ZERO, None, 0.0, 0);
        for part in parts {
            let (exitance, own) = part.merges(merges);
            emitted += exitance * part.area;
            range = Some(with(range, exitance));
            flux = f64::max(flux, own);
            shining += usize::from(exitance != DVec3::ZERO);
        }
        flux = flux.max(range.map_or(0.0, difference) * self.area);
        merges.push((flux, shining.saturating_sub(1)));
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
    let (mut flux, mut area, mut range) = (DVec3::ZERO, 0.0, None);
    for part in parts {
        let Emits::Evenly(exitance) = part.emits else { return None };
        range = Some(with(range, exitance));
        (flux, area) = (flux + exitance * part.area, area + part.area);
    }
    let range = range?;
    let is_one = difference(range) <= alike.exitance.max(EQUAL * range[1].max_element())
        || difference(range) * area <= alike.flux;
    (is_one && area > 0.0).then(|| flux / area)
}

/// The least and the largest exitance by channel, with another one.
fn with(range: Option<[DVec3; 2]>, exitance: DVec3) -> [DVec3; 2] {
    let [low, high] = range.unwrap_or([exitance; 2]);
    [low.min(exitance), high.max(exitance)]
}

/// Largest difference in any channel.
fn difference([low, high]: [DVec3; 2]) -> f64 {
    (high - low).max_element()
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
