//! Light sources: emitting polygons of constant exitance, lights that are no surface, and the sky.

use glam::DVec3;
use kernel::geometry::ConvexPolygon;
use kernel::row::{Row, Shape, Shooter};
use kernel::visibility::MANY_POLYGONS;

use super::emitters::emitters;
use super::sky;
use crate::error::BakeError;
use crate::jobs::{ReceiverSet, RowClient};
use crate::mesh::Mesh;
use crate::settings::BakeSettings;
use crate::solver::add_row;
use scene::{LightKind, Scene};

/// A light source with a row of its own.
#[derive(Clone)]
pub struct LightSource {
    /// What its row is made of.
    pub shooter: Shooter,
    /// What one unit of the row is worth: exitance of a polygon, intensity of a point or spot light per squared frame unit,
    /// irradiance across a directional light.
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

/// The light sources of a scene, whose mesh is that of the shares; their keys start at `first_key`. Those of a fine lamp, or of the
/// sky, are joined where `joined`: then rays tell what stands between all of them and a receiver.
pub fn sources(
    scene: &Scene,
    mesh: &Mesh,
    settings: &BakeSettings,
    first_key: u64,
    joined: bool,
) -> Vec<LightSource> {
    let facets = emitters(scene, mesh)
        .into_iter()
        .map(|emitter| (vec![emitter.polygon], emitter.exitance, Origin::Surface(emitter.surface)));
    let lights = scene.lights.iter().enumerate().map(|(index, light)| {
        let (shape, strength) = shooter(&light.kind, light.intensity, scene.frame.scale, settings);
        (shape, strength, Origin::Light(index))
    });
    let sky = sky::shapes(scene, settings.asked_error(), joined)
        .into_iter()
        .map(|(shape, exitance)| (shape, exitance, Origin::Sky));
    let shapes = |(polygons, exitance, origin)| (Shape::Polygons(polygons), exitance, origin);
    let facets = if joined { join(facets.collect()) } else { facets.collect() };
    let all: Vec<_> = facets.into_iter().map(shapes).chain(lights).chain(sky).collect();
    all.into_iter()
        .enumerate()
        .map(|(index, (shape, strength, origin))| LightSource {
            shooter: Shooter { key: first_key + index as u64, shape },
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

/// Emitting polygons, with their exitance and where they come from.
type Emitting = (Vec<ConvexPolygon>, DVec3, Origin);

/// Joins neighbours of one surface and exitance where they are many enough to be sampled; the others stay by themselves, exact.
fn join(polygons: Vec<Emitting>) -> Vec<Emitting> {
    let alike = |a: &Emitting, b: &Emitting| (a.1, a.2) == (b.1, b.2);
    let mut joined = vec![];
    for own in polygons.chunk_by(alike) {
        if own.len() < MANY_POLYGONS {
            joined.extend_from_slice(own);
            continue;
        }
        let parts = own.len().div_ceil(MOST_JOINED);
        joined.extend(own.chunks(own.len().div_ceil(parts)).map(|part| {
            let polygons = part.iter().flat_map(|(polygons, ..)| polygons.iter().cloned()).collect();
            (polygons, own[0].1, own[0].2)
        }));
    }
    joined
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

/// What the sources give some sets of receivers, in all. `look` sees each source with its row over the set of this index, and the
/// row's variance.
///
/// # Errors
/// When a row cannot be had.
pub fn irradiance_of(
    sources: &[LightSource],
    sets: &[ReceiverSet],
    client: &mut RowClient,
    mut look: impl FnMut(usize, &LightSource, &Row, f64),
) -> Result<Vec<Vec<DVec3>>, BakeError> {
    let shooters: Vec<Shooter> = sources.iter().map(|source| source.shooter.clone()).collect();
    let mut irradiance: Vec<_> = sets.iter().map(|set| vec![DVec3::ZERO; set.count()]).collect();
    client.each_row(&shooters, sets, |set, index, row, variance| {
        look(set, &sources[index], row, variance);
        add_row(&mut irradiance[set], row, sources[index].strength);
    })?;
    Ok(irradiance)
}

/// What the sources give a set of receivers, in all.
///
/// # Errors
/// When a row cannot be had.
pub fn irradiance(
    sources: &[LightSource],
    set: ReceiverSet,
    client: &mut RowClient,
) -> Result<Vec<DVec3>, BakeError> {
    Ok(irradiance_of(sources, &[set], client, |_, _, _, _| ())?.pop().unwrap_or_default())
}
