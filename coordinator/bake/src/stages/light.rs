//! Light sources: emitting polygons of constant exitance, lights that are no surface, and the sky.

use glam::DVec3;
use kernel::geometry::area_vector;
use kernel::row::{Row, Shape, Shooter};
use kernel::visibility::MANY_POLYGONS;

use super::emitters::{Emitter, emitters, weighted};
use super::sky;
use crate::error::BakeError;
use crate::jobs::{ReceiverSet, RowClient};
use crate::mesh::Mesh;
use crate::settings::BakeSettings;
use crate::solver::add_row;
use scene::{LightKind, Scene};

/// A light source. It has a row of its own, or glows.
#[derive(Clone)]
pub struct LightSource {
    /// What its row is made of. None where it glows: its light is then gathered like reflected light.
    pub shooter: Option<Shooter>,
    /// What one unit of the row is worth: exitance of a polygon, intensity of a point or spot light per squared frame unit,
    /// irradiance across a directional light. Of what glows, a factor of its exitance.
    pub strength: DVec3,
    /// What of the scene it is.
    pub origin: Origin,
    /// True where its light comes from outside of the scene: of what it emits only what falls on the scene is counted.
    pub is_outside: bool,
}

/// What of a scene a light source is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// A facet, or a part of one, of the surface with this index.
    Surface(usize),
    /// The light with this index.
    Light(usize),
    /// A part of the sky.
    Sky,
}

/// Most polygons of a joint light source: its row must fit a job.
const MOST_JOINED: usize = 1024;

/// Emitters of a scene beyond which those of a surface are joined from [`FEW_POLYGONS`] on: an exact row for each takes too long.
pub const MANY_EMITTERS: usize = 256;
const FEW_POLYGONS: usize = 8;

/// Colours that differ by less than this part of their strongest channel are one.
const ONE_COLOUR: f64 = 1.0 / 64.0;

/// The light sources of a scene, whose mesh is that of the shares; their keys start at `first_key`. Those of a fine lamp, or of the
/// sky, are joined where `joined`: then rays tell what stands between all of them and a receiver.
pub fn sources(
    scene: &Scene,
    mesh: &Mesh,
    settings: &BakeSettings,
    first_key: u64,
    joined: bool,
) -> Vec<LightSource> {
    let error = settings.asked_error();
    let facets = emitters(scene, mesh, joined.then_some(error));
    let facets = if joined { join(facets) } else { facets.into_iter().map(alone).collect() };
    let lights = scene.lights.iter().enumerate().map(|(index, light)| {
        let (shape, strength) = shooter(&light.kind, light.intensity, scene.frame.scale, settings);
        (shape, strength, Origin::Light(index))
    });
    let sky = sky::shapes(scene, settings, joined)
        .into_iter()
        .map(|(shape, exitance)| (shape, exitance, Origin::Sky));
    let all: Vec<_> = facets.into_iter().chain(lights).chain(sky).collect();
    all.into_iter()
        .enumerate()
        .map(|(index, (shape, strength, origin))| LightSource {
            shooter: Some(Shooter { key: first_key + index as u64, shape }),
            strength,
            origin,
            is_outside: match origin {
                Origin::Surface(_) => false,
                Origin::Light(index) => scene.lights[index].kind.from_far().is_some(),
                Origin::Sky => true,
            },
        })
        .collect()
}

/// What shines, its exitance and where it comes from.
type Shining = (Shape, DVec3, Origin);

/// An emitter by itself, exact.
fn alone(Emitter { surface, polygon, exitance }: Emitter) -> Shining {
    (Shape::Polygons(vec![polygon]), exitance, Origin::Surface(surface))
}

/// Joins the emitters of each surface where they are many enough to be sampled; the others stay by themselves, exact.
fn join(emitters: Vec<Emitter>) -> Vec<Shining> {
    let least = if emitters.len() > MANY_EMITTERS { FEW_POLYGONS } else { MANY_POLYGONS };
    let mut joined = vec![];
    for own in emitters.chunk_by(|a, b| a.surface == b.surface) {
        let mut others = vec![];
        for even in own.chunk_by(|a, b| a.exitance == b.exitance) {
            if even.len() < MANY_POLYGONS {
                others.extend_from_slice(even);
                continue;
            }
            joined.extend(parts_of(even).map(|part| {
                let polygons = part.iter().map(|emitter| emitter.polygon.clone()).collect();
                (Shape::Polygons(polygons), part[0].exitance, Origin::Surface(part[0].surface))
            }));
        }
        if others.len() < least {
            joined.extend(others.into_iter().map(alone));
        } else {
            joined.extend(parts_of(&others).flat_map(by_colour));
        }
    }
    joined
}

/// Parts of about one size, none too large for a job.
fn parts_of(emitters: &[Emitter]) -> impl Iterator<Item = &[Emitter]> {
    let parts = emitters.len().div_ceil(MOST_JOINED);
    emitters.chunks(emitters.len().div_ceil(parts))
}

/// Emitters of one surface as shapes with weights: one where all have about one colour, else one for each channel.
fn by_colour(emitters: &[Emitter]) -> Vec<Shining> {
    let origin = Origin::Surface(emitters[0].surface);
    let strongest = |emitter: &Emitter| emitter.exitance.max_element();
    let area = |emitter: &Emitter| area_vector(&emitter.polygon.corners).length();
    let flux: DVec3 = emitters.iter().map(|emitter| area(emitter) * emitter.exitance).sum();
    // Of what the strongest channel would give: so that the flux is right in each.
    let colour = flux / emitters.iter().map(|emitter| area(emitter) * strongest(emitter)).sum::<f64>();
    let has_it = |emitter: &Emitter| {
        (emitter.exitance / strongest(emitter) - colour).abs().max_element() <= ONE_COLOUR
    };
    let channels = if emitters.iter().all(has_it) {
        vec![(DVec3::ONE, colour)]
    } else {
        [DVec3::X, DVec3::Y, DVec3::Z].map(|channel| (channel, channel)).to_vec()
    };
    channels
        .into_iter()
        .filter_map(|(channel, colour)| {
            let polygons = emitters.iter().map(|emitter| (emitter.polygon.clone(), emitter.exitance));
            weighted(polygons, channel).map(|(shape, most)| (shape, colour * most, origin))
        })
        .collect()
}

/// The shape of a light that is no surface, and what one unit of its row is worth.
fn shooter(kind: &LightKind, intensity: DVec3, scale: f64, settings: &BakeSettings) -> (Shape, DVec3) {
    let per_square = intensity / (scale * scale);
    match *kind {
        LightKind::Point { position } if settings.planar_point_lights => {
            (Shape::PlanarPoint(position), per_square)
        }
        LightKind::Point { position } => (Shape::Point(position), per_square),
        LightKind::Spot(spot) => (Shape::Spot(spot), per_square),
        LightKind::Directional { along } => (Shape::Directional(along), intensity),
        LightKind::Area(area) => (Shape::Polygons(vec![area.polygon()]), std::f64::consts::PI * intensity),
    }
}

/// How many light sources there are of each sort.
#[derive(Default)]
pub struct SourceCounts {
    pub area: usize,
    pub point: usize,
    pub spot: usize,
    pub directional: usize,
    pub sky: usize,
}

impl SourceCounts {
    pub fn new(scene: &Scene, sources: &[LightSource]) -> Self {
        let mut counts = Self::default();
        for source in sources {
            *match source.origin {
                Origin::Surface(_) => &mut counts.area,
                Origin::Light(index) => match scene.lights[index].kind {
                    LightKind::Point { .. } => &mut counts.point,
                    LightKind::Spot(_) => &mut counts.spot,
                    LightKind::Directional { .. } => &mut counts.directional,
                    LightKind::Area(_) => &mut counts.area,
                },
                Origin::Sky => &mut counts.sky,
            } += 1;
        }
        counts
    }
}

/// Irradiance of some receivers straight from sources.
#[derive(Clone, Default)]
pub struct Direct {
    /// From all of them.
    pub all: Vec<DVec3>,
    /// The part that comes from lights within the scene that are no surfaces.
    pub from_lights: Vec<DVec3>,
    /// The part that comes from outside of the scene, from directional lights and the sky.
    pub from_outside: Vec<DVec3>,
}

impl Direct {
    fn dark(receivers: usize) -> Self {
        let [all, from_lights, from_outside] = [(); 3].map(|()| vec![DVec3::ZERO; receivers]);
        Self { all, from_lights, from_outside }
    }

    fn add_row(&mut self, row: &Row, source: &LightSource) {
        add_row(&mut self.all, row, source.strength);
        if source.is_outside {
            add_row(&mut self.from_outside, row, source.strength);
        } else if let Origin::Light(_) = source.origin {
            add_row(&mut self.from_lights, row, source.strength);
        }
    }

    /// Each part by itself changed.
    pub fn map(self, mut change: impl FnMut(Vec<DVec3>) -> Vec<DVec3>) -> Self {
        let Self { all, from_lights, from_outside } = self;
        Self { all: change(all), from_lights: change(from_lights), from_outside: change(from_outside) }
    }
}

/// Adds to the light of some sets of receivers what the rows of the sources give them. `look` sees each source with its row over the
/// set of this index, and the row's variance.
///
/// # Errors
/// When a row cannot be had.
pub fn add_direct<'a>(
    light: &mut [Direct],
    sources: impl Iterator<Item = &'a LightSource>,
    sets: &[ReceiverSet],
    client: &mut RowClient,
    mut look: impl FnMut(usize, u64, f64),
) -> Result<(), BakeError> {
    let (sources, shooters): (Vec<&LightSource>, Vec<Shooter>) =
        sources.filter_map(|source| Some((source, source.shooter.clone()?))).unzip();
    client.each_row(&shooters, sets, |set, index, row, variance| {
        look(set, shooters[index].key, variance);
        light[set].add_row(row, sources[index]);
    })
}

/// No light at the receivers of some sets.
pub fn no_light(sets: &[ReceiverSet]) -> Vec<Direct> {
    sets.iter().map(|set| Direct::dark(set.count())).collect()
}

/// What the rows of the sources give a set of receivers.
///
/// # Errors
/// When a row cannot be had.
pub fn direct(
    sources: &[LightSource],
    set: ReceiverSet,
    client: &mut RowClient,
) -> Result<Direct, BakeError> {
    let mut light = no_light(&[set]);
    add_direct(&mut light, sources.iter(), &[set], client, |_, _, _| ())?;
    Ok(light.pop().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use kernel::geometry::{ConvexPolygon, PlaneId};

    use super::*;

    fn emitter(index: u32, exitance: DVec3) -> Emitter {
        let low = f64::from(index);
        let edge = 0.2 + 0.01 * low;
        let corners =
            [(0.0, 0.0), (edge, 0.0), (edge, 0.5), (0.0, 0.5)].map(|(x, y)| DVec3::new(low + x, y, 0.0));
        Emitter {
            surface: 3,
            polygon: ConvexPolygon { plane: PlaneId(0), corners: corners.to_vec() },
            exitance,
        }
    }

    fn flux_of(emitters: &[Emitter]) -> DVec3 {
        emitters.iter().map(|own| area_vector(&own.polygon.corners).length() * own.exitance).sum()
    }

    fn flux(shining: &[Shining]) -> DVec3 {
        let area = |polygon: &ConvexPolygon| area_vector(&polygon.corners).length();
        let of_shape = |shape: &Shape| -> f64 {
            match shape {
                Shape::Polygons(polygons) => polygons.iter().map(area).sum(),
                Shape::Weighted(polygons) => {
                    polygons.iter().map(|(polygon, weight)| area(polygon) * weight).sum()
                }
                other => panic!("{other:?} is no surface"),
            }
        };
        shining.iter().map(|(shape, strength, _)| *strength * of_shape(shape)).sum::<DVec3>()
    }

    #[test]
    fn joined_emitters_keep_their_flux_in_each_channel() {
        // Of one colour, of nearly one, of many.
        let brightness = |index: u32| 1.0 + f64::from(index % 7);
        let colours: [fn(u32) -> DVec3; 3] = [
            |_| DVec3::new(1.0, 0.5, 0.25),
            |index| DVec3::new(1.0, 0.5 + 0.001 * f64::from(index % 5), 0.25),
            |index| DVec3::from_array([0, 1, 2].map(|channel| f64::from((index + channel) % 3))),
        ];
        for (colour, rows) in colours.into_iter().zip([1, 1, 3]) {
            let emitters: Vec<Emitter> =
                (0..40).map(|index| emitter(index, colour(index) * brightness(index))).collect();
            let joined = join(emitters.clone());
            assert_eq!(joined.len(), rows);
            assert!(joined.iter().all(|(_, _, origin)| *origin == Origin::Surface(3)));
            let wanted = flux_of(&emitters);
            assert!((flux(&joined) - wanted).abs().max_element() <= 1e-12 * wanted.max_element());
        }
    }

    #[test]
    fn few_emitters_stay_exact_and_very_many_go_into_several_rows() {
        let few: Vec<Emitter> =
            (0..20).map(|index| emitter(index, DVec3::splat(f64::from(index + 1)))).collect();
        assert!(join(few).iter().all(|(shape, ..)| matches!(shape, Shape::Polygons(one) if one.len() == 1)));
        let many: Vec<Emitter> =
            (0..3000).map(|index| emitter(index, DVec3::splat(f64::from(index % 9 + 1)))).collect();
        let joined = join(many.clone());
        assert_eq!(joined.len(), 3);
        assert!(joined.iter().all(|(shape, ..)| shape.polygons() <= MOST_JOINED));
        let wanted = flux_of(&many);
        assert!((flux(&joined) - wanted).abs().max_element() <= 1e-12 * wanted.max_element());
    }
}
