//! Light straight from its sources.

use std::cell::LazyCell;
use std::collections::HashMap;

use glam::DVec3;
use kernel::row::Row;

use super::glow::{Emissions, add, is_of, make_glow};
use super::light::{self, LightSource, Origin};
use super::setup::Setup;
use crate::context::Context;
use crate::error::Result;
use crate::jobs::ReceiverSet;
use crate::observer::Phase;
use crate::refinement::SamplePoints;
use crate::rows::{COARSE, Rows, ShareMesh};

/// A bake with direct light.
pub struct Lit {
    pub mesh: ShareMesh,
    pub rows: Rows,
    pub sources: Sources,
    /// Refinement samples, with their direct light.
    pub samples: SamplePoints,
    /// Middles of large leaves, with their direct light.
    pub middles: SamplePoints,
    /// Irradiance of the vertices of the shooting mesh, but for what glows.
    pub direct: Vec<DVec3>,
}

/// The light sources, and what their rows tell beside irradiance.
pub struct Sources {
    pub all: Vec<LightSource>,
    /// Variance of the row of each over the refinement samples, summed over it.
    pub variances: Vec<f64>,
    /// Flux that the shares stop straight from all sources, in frame units. Known once there is a solution.
    pub received: DVec3,
    /// The part of it that comes from lights within the scene that are no surfaces.
    pub from_lights: DVec3,
    /// The part that comes from outside of the scene, from directional lights and the sky.
    pub from_outside: DVec3,
}

impl Setup {
    /// Computes the direct light at the vertices of the shooting mesh and at the refinement samples.
    #[tracing::instrument(skip_all)]
    pub fn light(self, cx: &mut Context) -> Result<Lit> {
        let Self { mesh, mut rows, mut sources, mut samples, mut middles } = self;
        cx.client.monitor.enter(Phase::Light, mesh.mesh.vertices.len());
        let (mut from_lights, mut from_outside) = (DVec3::ZERO, DVec3::ZERO);
        let Rows { source, table } = &mut rows;
        let mut variances: HashMap<u64, f64> = HashMap::new();
        if samples.count() > 0 {
            let receivers = samples.receivers(samples.count());
            table.samples = Some(source.add_receivers(cx, table, &receivers, None)?);
        }
        if middles.count() > 0 {
            let receivers = middles.receivers(middles.count());
            table.middles = Some(source.add_receivers(cx, table, &receivers, None)?);
        }
        // Nothing is known to be dark before the rows were looked at.
        let all_exposed = vec![true; mesh.mesh.vertices.len()];
        let values = LazyCell::new(|| source.first_values(&mesh, &all_exposed));
        let vertices = &table.vertices;
        let ids = [table.samples, table.middles, Some(COARSE)].into_iter().flatten();
        let sets: Vec<ReceiverSet> = ids.map(|id| table.set(id)).collect();
        let (of_samples, of_vertices) = (table.samples.map(|_| 0), sets.len() - 1);
        let stopped_area: Vec<f64> = mesh
            .energies
            .iter()
            .zip(&mesh.materials)
            .map(|(share, material)| share.area * material.opacity)
            .collect();
        let mut look = |set, source: &LightSource, row: &Row, variance| {
            if let Some(shooter) = source.shooter.as_ref().filter(|_| Some(set) == of_samples) {
                variances.insert(shooter.key, variance);
            }
            if set != of_vertices || matches!(source.origin, Origin::Surface(_)) {
                return;
            }
            let factors: Vec<f64> = vertices.of_coarse(row.to_dense().into_iter().map(f64::from).collect());
            let of_shares = values.of(&mesh.energies, &factors);
            let flux = stopped_area.iter().zip(of_shares).map(|(area, factor)| area * factor).sum::<f64>();
            *if source.is_outside { &mut from_outside } else { &mut from_lights } += source.strength * flux;
        };
        let emissions =
            if source.joins_sources() { Emissions::of_many(&sources) } else { Emissions::default() };
        let (mut later, first): (Vec<LightSource>, Vec<LightSource>) =
            sources.iter().cloned().partition(|source| emissions.has(source));
        let mut light = light::irradiance_of(&first, &sets, cx.client, &mut look)?;
        if !later.is_empty() {
            let received = values.of(&mesh.energies, &vertices.of_coarse(light[of_vertices].clone()));
            let area: f64 = mesh.energies.iter().map(|share| share.area).sum();
            let flux: DVec3 =
                mesh.energies.iter().zip(received).map(|(share, light)| share.area * light).sum();
            let level = flux.element_sum() / 3.0 / area;
            let rays = source.rays(cx.settings);
            let glowing = emissions.glowing(level, area, rays, cx.settings.asked_error());
            tracing::debug!(level, surfaces = glowing.len(), "surfaces glow");
            make_glow(&mut sources, &glowing);
            later.retain(|source| !is_of(source, &glowing));
            let more = light::irradiance_of(&later, &sets, cx.client, &mut look)?;
            light.iter_mut().zip(&more).for_each(|(light, more)| add(light, more));
        }
        let mut light = light.into_iter();
        if table.samples.is_some() {
            samples.set_direct(light.next().unwrap_or_default());
        }
        if table.middles.is_some() {
            middles.set_direct(light.next().unwrap_or_default());
        }
        let direct = light.next().unwrap_or_default();
        let direct = vertices.of_coarse(direct);
        cx.end_step("light");
        mesh.preview(cx, &direct, || {
            let dark = vec![DVec3::ZERO; mesh.shares.len()];
            (direct.clone(), mesh.unshot(&values.of(&mesh.energies, &direct), &dark))
        });
        let variance = |source: &LightSource| {
            let key = source.shooter.as_ref().map(|shooter| shooter.key);
            key.and_then(|key| variances.get(&key)).copied().unwrap_or(0.0)
        };
        let variances = sources.iter().map(variance).collect();
        let sources = Sources { all: sources, variances, received: DVec3::ZERO, from_lights, from_outside };
        Ok(Lit { mesh, rows, sources, samples, middles, direct })
    }
}
