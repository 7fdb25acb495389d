//! Light sources: emitting polygons of constant exitance, lights that are no surface, and the sky.

use glam::DVec3;
use kernel::row::{Row, Shape, Shooter};

use super::emitters::emitters;
use super::joint::{alone, join};
use super::light_source::{LightSource, Origin};
use super::sky;
use crate::error::BakeError;
use crate::jobs::{ReceiverSet, RowClient};
use crate::mesh::Mesh;
use crate::settings::BakeSettings;
use crate::solver::add_row;
use scene::{LightKind, Scene};

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
                Origin::Surface(_) | Origin::Lamps => false,
                Origin::Light(index) => scene.lights[index].kind.from_far().is_some(),
                Origin::Sky => true,
            },
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
                Origin::Surface(_) | Origin::Lamps => &mut counts.area,
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
    /// Sky view factor of each receiver: the part of its hemisphere in which it sees an even sky. `None` without such a sky, and where its
    /// light does not come by rays.
    pub sky_views: Option<Vec<f64>>,
}

impl Direct {
    fn dark(receivers: usize) -> Self {
        let [all, from_lights, from_outside] = [(); 3].map(|()| vec![DVec3::ZERO; receivers]);
        Self { all, from_lights, from_outside, sky_views: None }
    }

    fn add_row(&mut self, row: &Row, source: &LightSource) {
        add_row(&mut self.all, row, source.strength);
        if source.is_outside {
            add_row(&mut self.from_outside, row, source.strength);
        } else if let Origin::Light(_) = source.origin {
            add_row(&mut self.from_lights, row, source.strength);
        }
        // There is one such source at most.
        if let Some(Shooter { shape: Shape::Sky(_), .. }) = &source.shooter {
            let views = self.sky_views.get_or_insert_with(|| vec![0.0; self.all.len()]);
            row.iter().for_each(|(receiver, factor)| views[receiver] = f64::from(factor));
        }
    }

    /// Light of each sort by itself changed, to that of other places: their views of the sky are not known.
    pub fn map(self, mut change: impl FnMut(Vec<DVec3>) -> Vec<DVec3>) -> Self {
        let Self { all, from_lights, from_outside, .. } = self;
        let [all, from_lights, from_outside] = [all, from_lights, from_outside].map(&mut change);
        Self { all, from_lights, from_outside, sky_views: None }
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
    mut look: impl FnMut(usize, &LightSource, f64),
) -> Result<(), BakeError> {
    let (sources, shooters): (Vec<&LightSource>, Vec<Shooter>) =
        sources.filter_map(|source| Some((source, source.shooter.clone()?))).unzip();
    client.each_row(&shooters, sets, |set, index, row, variance| {
        look(set, sources[index], variance);
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
