//! Surfaces that glow: their light is gathered with that which surfaces reflect.
//!
//! An emissive texture over a whole scene is thousands of light sources. A row for each, or rays to them from each vertex, take
//! minutes. Where they are about as bright as what is lit, and fill much of what is seen, the rays of the gather points meet them as
//! often as they meet reflected light: then these rays are enough.

use std::collections::{BTreeMap, HashSet};

use glam::DVec3;

use super::emitters::MOST_JOINED;
use super::joint::MANY_EMITTERS;
use super::light_source::{LightSource, Origin};
use crate::context::Context;
use crate::error::Result;
use crate::error_budget::INTERPOLATED_NOISE;
use crate::rows::{Radiosity, Rows, ShareMesh};
use crate::solver::cache::SetId;

/// Emitting polygons whose rows take so little time that they neither glow nor share rows.
const FEW_EMITTERS: usize = 32;

/// Largest exitance of what glows, relative to the mean irradiance: brighter things would leave spots near them. With more rays than the
/// error needs it grows as their noise falls.
const BRIGHTEST: f64 = 8.0;

/// Factors of the rays of gather points that may be worth the rows which they spare.
const MORE_RAYS: [u32; 3] = [2, 4, 8];

/// Time of a joint row over all vertices, in units of that of the usual rays of all gather points.
const TIME_OF_ROW: usize = 2;

/// Rays that meet what glows from a place, at least, in the mean: of a small lamp they would tell too little to those near it.
const LEAST_RAYS: f64 = 8.0;

/// Part of the asked error that the noise of glowing light may have.
const PART_OF_ERROR: f64 = 0.5;

/// What light is gathered with.
#[derive(Clone, Copy)]
pub struct Gathering {
    /// Mean irradiance of the scene, from all but the surfaces that may glow.
    pub level: f64,
    /// Area of the scene.
    pub area: f64,
    /// Rays of a gather point.
    pub rays: u32,
    /// Rays of a gather point that the asked error needs.
    pub usual_rays: u32,
    /// The asked error.
    pub error: f64,
}

/// What a surface emits.
#[derive(Default)]
struct Emission {
    /// Polygons that emit in each channel.
    polygons: [usize; 3],
    /// Polygons of all its sources; those of channels of one shape count once, as their rows take as long as one.
    of_sources: usize,
    /// Area, counted in each channel that it emits in.
    area: DVec3,
    /// Sums over its area of the exitance and of its square, and the largest exitance, by channel.
    flux: DVec3,
    square: DVec3,
    largest: DVec3,
}

/// The emitting surfaces of sources.
#[derive(Default)]
pub struct Emissions {
    surfaces: BTreeMap<usize, Emission>,
    /// Polygons of all of them.
    polygons: usize,
}

impl Emissions {
    /// Of surfaces that have rows; none unless their polygons are many.
    pub fn of_many(sources: &[LightSource]) -> Self {
        let mut surfaces: BTreeMap<usize, Emission> = BTreeMap::new();
        for source in sources {
            let (Origin::Surface(surface), Some(shooter)) = (source.origin, &source.shooter) else {
                continue;
            };
            let own = surfaces.entry(surface).or_default();
            if shooter.shape.channel() == 0 {
                own.of_sources += shooter.shape.polygons();
            }
            for (polygon, weight) in shooter.shape.weighted_polygons().filter(|(_, weight)| *weight > 0.0) {
                let (area, exitance) = (polygon.area(), weight * source.strength);
                for channel in (0..3).filter(|channel| exitance[*channel] > 0.0) {
                    own.polygons[channel] += 1;
                    own.area[channel] += area;
                }
                own.flux += area * exitance;
                own.square += area * exitance * exitance;
                own.largest = own.largest.max(exitance);
            }
        }
        // A surface of several colours has a row, and its polygons, for each channel.
        let polygons: usize = surfaces.values().filter_map(|own| own.polygons.into_iter().max()).sum();
        if polygons > FEW_EMITTERS { Self { surfaces, polygons } } else { Self::default() }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.surfaces.is_empty()
    }

    /// Mean irradiance of a scene of this area from those surfaces that count.
    pub fn mean_irradiance(&self, area: f64, counts: impl Fn(usize) -> bool) -> DVec3 {
        let own = self.surfaces.iter().filter(|(surface, _)| counts(**surface));
        own.map(|(_, own)| own.flux).sum::<DVec3>() / area
    }

    /// Whether one of these surfaces is the source.
    pub fn has(&self, source: &LightSource) -> bool {
        matches!(source.origin, Origin::Surface(surface) if self.surfaces.contains_key(&surface))
    }

    /// The number of rays, if any, with which more surfaces glow, and that takes less time than their rows.
    pub fn rays_worth_while(&self, gathering: &Gathering) -> Option<u32> {
        let time_of_rows = |rays: u32| {
            let glowing = self.glowing(&Gathering { rays, ..*gathering });
            let others = self.surfaces.iter().filter(|(surface, _)| !glowing.contains(surface));
            let polygons: usize = others.map(|(_, own)| own.of_sources).sum();
            polygons.div_ceil(MOST_JOINED) * TIME_OF_ROW
        };
        let with = |more: u32| {
            let rays = more * gathering.rays;
            (time_of_rows(rays) + (rays / gathering.usual_rays) as usize, rays)
        };
        let (time, rays) = MORE_RAYS.map(with).into_iter().min()?;
        (time < time_of_rows(gathering.rays)).then_some(rays)
    }

    /// The surfaces that glow: as many of the dimmest as stay under [`BRIGHTEST`], which rays meet often enough for the asked error; and
    /// those so faint that their noise is small wherever they are seen from. None where rows take no long time.
    pub fn glowing(&self, gathering: &Gathering) -> HashSet<usize> {
        if self.polygons <= MANY_EMITTERS {
            return HashSet::new();
        }
        let Gathering { level, area, rays, usual_rays, error } = *gathering;
        let brightest = BRIGHTEST * (f64::from(rays) / f64::from(usual_rays)).max(1.0).sqrt();
        let mut dimmest: Vec<(usize, &Emission)> =
            self.surfaces.iter().map(|(surface, own)| (*surface, own)).collect();
        dimmest.sort_by(|a, b| a.1.largest.max_element().total_cmp(&b.1.largest.max_element()));
        let level = level + self.mean_irradiance(area, |_| true).element_sum() / 3.0;
        let allowed = (PART_OF_ERROR * error * level).powi(2);
        let (mut flux, mut square, mut emitting, mut count) = (DVec3::ZERO, DVec3::ZERO, 0.0, 0);
        for (index, (_, own)) in dimmest.iter().enumerate() {
            flux += own.flux;
            square += own.square;
            // Of rays that meet a surface as often as its part of the area is.
            let mean = flux / area;
            let noise = |variance: f64| variance / f64::from(rays) * INTERPOLATED_NOISE;
            let largest = own.largest.max_element();
            let is_dim = largest <= brightest * level;
            // Most where it fills half of what is seen.
            let is_faint = noise((largest / 2.0).powi(2)) <= allowed;
            // Rays that meet what is faint do not tell of brighter things.
            emitting += if is_faint { 0.0 } else { own.area.max_element() };
            let is_met = emitting / area * f64::from(rays) >= LEAST_RAYS;
            let is_even = noise((square / area - mean * mean).max_element()) <= allowed;
            if is_dim && (is_faint || is_met && is_even) {
                count = index + 1;
            }
        }
        dimmest[..count].iter().map(|(surface, _)| *surface).collect()
    }
}

/// Whether a source is one of these surfaces.
fn is_of(source: &LightSource, surfaces: &HashSet<usize>) -> bool {
    matches!(source.origin, Origin::Surface(surface) if surfaces.contains(&surface))
}

/// Takes the rows from the sources that these surfaces are: one is left of each.
pub fn make_glow(sources: &mut Vec<LightSource>, surfaces: &HashSet<usize>) {
    for source in sources.iter_mut().filter(|source| is_of(source, surfaces)) {
        (source.shooter, source.strength) = (None, DVec3::ONE);
    }
    sources.dedup_by(|one, other| {
        one.shooter.is_none() && other.shooter.is_none() && one.origin == other.origin
    });
}

/// Exitance of the shares that glow with these sources; `None` where none does.
pub fn glow(mesh: &ShareMesh, sources: &[LightSource]) -> Option<Vec<DVec3>> {
    let glows = sources.iter().filter(|source| source.shooter.is_none());
    let factors: BTreeMap<usize, DVec3> = glows
        .filter_map(|source| match source.origin {
            Origin::Surface(surface) => Some((surface, source.strength)),
            _ => None,
        })
        .collect();
    if factors.is_empty() {
        return None;
    }
    let shares = mesh.shares.iter().zip(&mesh.materials);
    let of_share = |surface: u32| factors.get(&(surface as usize)).copied().unwrap_or(DVec3::ZERO);
    Some(shares.map(|(share, material)| material.exitance * of_share(share.surface)).collect())
}

/// What these sources that glow give the receivers of some sets; nothing where none glows.
pub fn light_at(
    cx: &mut Context,
    mesh: &ShareMesh,
    rows: &mut Rows,
    sources: &[LightSource],
    sets: &[SetId],
) -> Result<Vec<Vec<DVec3>>> {
    let Some(glow) = glow(mesh, sources) else { return Ok(vec![]) };
    let Rows { source, table } = rows;
    let gathered = source.gather(cx, mesh, table, sets, &[Radiosity::even(&glow)], false)?;
    Ok(gathered.into_iter().flat_map(|gathered| gathered.light).collect())
}

/// Adds light to other light of the same receivers.
pub fn add(light: &mut [DVec3], other: &[DVec3]) {
    light.iter_mut().zip(other).for_each(|(light, other)| *light += *other);
}

#[cfg(test)]
mod tests {
    use kernel::geometry::{ConvexPolygon, PlaneId};
    use kernel::row::{Shape, Shooter};

    use super::*;

    const AREA: f64 = 4000.0;

    /// Unit squares of one surface that emit so much.
    fn squares(surface: usize, count: usize, exitance: f64) -> LightSource {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y].to_vec();
        let polygon = ConvexPolygon { plane: PlaneId(0), corners };
        LightSource {
            shooter: Some(Shooter { key: surface as u64, shape: Shape::Polygons(vec![polygon; count]) }),
            strength: DVec3::splat(exitance),
            origin: Origin::Surface(surface),
            is_outside: false,
        }
    }

    fn gathering(level: f64) -> Gathering {
        Gathering { level, area: AREA, rays: 256, usual_rays: 256, error: 0.1 }
    }

    fn glowing(sources: &[LightSource], level: f64) -> Vec<usize> {
        let mut glowing: Vec<usize> =
            Emissions::of_many(sources).glowing(&gathering(level)).into_iter().collect();
        glowing.sort_unstable();
        glowing
    }

    #[test]
    fn what_is_dim_and_large_glows() {
        let (dim, bright) = (squares(0, 1000, 1.0), squares(1, 300, 100.0));
        // The light of both, or of others, makes the one dim and never the other.
        assert_eq!(glowing(&[dim.clone(), bright.clone()], 1.0), [0]);
        assert_eq!(glowing(&[bright], 1.0), [0; 0]);
        assert_eq!(glowing(&[dim], 10.0), [0]);
        // Few rays meet what is small: it must be faint.
        let small = |exitance: f64| [(); 3].map(|()| squares(0, 100, exitance));
        let in_large_scene = |exitance: f64| {
            let gathering = Gathering { area: 100.0 * AREA, ..gathering(1.0) };
            Emissions::of_many(&small(exitance)).glowing(&gathering)
        };
        assert_eq!(glowing(&small(3.0), 1.0), [0]);
        assert_eq!(in_large_scene(3.0), HashSet::new());
        assert_eq!(in_large_scene(2.0), HashSet::from([0]));
        // Rays that meet what is faint do not help it.
        assert_eq!(glowing(&[squares(0, 3000, 1.0), squares(1, 20, 5.0)], 0.0), [0]);
        // Large enough, it may be brighter; never very bright, whatever the error.
        assert_eq!(glowing(&[squares(0, 350, 4.0)], 0.65), [0]);
        let bright = squares(0, 400, 10.0);
        let loose = Gathering { error: 0.5, ..gathering(0.0) };
        assert_eq!(Emissions::of_many(&[bright]).glowing(&loose), HashSet::new());
        // Alone in the dark, a part of the scene that rays seldom meet is no even light.
        assert_eq!(glowing(&[squares(0, 300, 1.0)], 0.0), [0; 0]);
        assert_eq!(glowing(&[squares(0, 3500, 1.0)], 0.0), [0]);
        // A few sources are no reason.
        assert_eq!(glowing(&[squares(0, MANY_EMITTERS, 1.0)], 10.0), [0; 0]);
        let in_channels = [DVec3::X, DVec3::Y, DVec3::Z]
            .map(|strength| LightSource { strength, ..squares(0, MANY_EMITTERS, 1.0) });
        assert_eq!(glowing(&in_channels, 10.0), [0; 0]);
    }

    #[test]
    fn more_rays_are_taken_where_they_spare_more_rows() {
        // In scenes that have forty times their area.
        let worth = |count: usize, exitance: f64| {
            let emissions = Emissions::of_many(&[squares(0, count, exitance)]);
            emissions.rays_worth_while(&Gathering { area: 40.0 * count as f64, ..gathering(1.0) })
        };
        assert_eq!(worth(40_000, 2.0), None);
        assert_eq!(worth(40_000, 14.0), Some(1024));
        assert_eq!(worth(40_000, 24.0), Some(2048));
        assert_eq!(worth(40_000, 100.0), None);
        // Few rows take less time.
        assert_eq!(worth(5000, 10.0), Some(512));
        assert_eq!(worth(5000, 14.0), None);
        assert_eq!(worth(1000, 10.0), None);
    }

    #[test]
    fn one_source_is_left_of_a_surface_that_glows() {
        let mut sources = vec![squares(0, 200, 1.0), squares(0, 200, 2.0), squares(1, 3, 100.0)];
        make_glow(&mut sources, &HashSet::from([0]));
        let shooters: Vec<bool> = sources.iter().map(|source| source.shooter.is_some()).collect();
        assert_eq!(shooters, [false, true]);
    }
}
