//! Light straight from its sources.

use std::cell::LazyCell;
use std::ops::ControlFlow;

use glam::DVec3;

use super::glow::{Emissions, Gathering, make_glow};
use super::joint::pool;
use super::light::Direct;
use super::light_source::{LightSource, Origin};
use super::new_start::NewStart;
use super::samples_first::SamplesFirst;
use super::setup::Setup;
use super::shooting_mesh::ShootingMesh;
use crate::context::Context;
use crate::error::Result;
use crate::jobs::ReceiverSet;
use crate::observer::Phase;
use crate::refinement::SamplePoints;
use crate::rows::{COARSE, Rows, ShareMesh};
use crate::settings::BakeSettings;
use crate::solver::ShareEnergy;
use crate::solver::cache::SetId;

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
    pub direct: Direct,
}

/// The light sources, and what their rows tell beside irradiance.
pub struct Sources {
    /// Those that have rows or glow.
    pub all: Vec<LightSource>,
    /// Each by itself, where small lamps share rows.
    apart: Option<Vec<LightSource>>,
    /// Variance of the row of each over the refinement samples, summed over it.
    pub variances: Vec<f64>,
}

impl Sources {
    /// Each light source by itself.
    pub fn each(&self) -> &[LightSource] {
        self.apart.as_ref().unwrap_or(&self.all)
    }
}

impl Setup {
    /// Computes the direct light at the vertices of the shooting mesh and at the refinement samples. Breaks with settings to start anew
    /// with, where more rays spare it the rows of many light sources, or it has too much noise.
    #[tracing::instrument(skip_all)]
    pub fn light(self, cx: &mut Context) -> Result<ControlFlow<NewStart, Lit>> {
        let Self { mesh, longest_edge, mut rows, mut sources, mut samples, mut middles } = self;
        cx.client.monitor.enter(Phase::Light, mesh.mesh.vertices.len());
        let Rows { source, table } = &mut rows;
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
        let ids: Vec<SetId> = [table.samples, table.middles, Some(COARSE)].into_iter().flatten().collect();
        let sets: Vec<ReceiverSet> = ids.iter().map(|id| table.set(*id)).collect();
        let emissions =
            if source.joins_sources() { Emissions::of_many(&sources) } else { Emissions::default() };
        let area: f64 = mesh.energies.iter().map(|share| share.area).sum();
        let rays_to_sources = source.joins_sources().then(|| source.rays_to_sources(cx.settings));
        let mut light = SamplesFirst::new(&sets, &samples, rays_to_sources);
        let mut apart = None;
        let others: Vec<&LightSource> = sources.iter().filter(|source| !emissions.has(source)).collect();
        let mut better = light.add(cx, &others, emissions.mean_irradiance(area, |_| true))?;
        if better.is_none() && !emissions.is_empty() {
            let direct = vertices.of_coarse(light.light[sets.len() - 1].all.clone());
            let received = values.of(&mesh.energies, &direct);
            let flux: DVec3 =
                mesh.energies.iter().zip(&received).map(|(share, light)| share.area * *light).sum();
            let level = flux.element_sum() / 3.0 / area;
            let error = cx.settings.asked_error();
            let rays = source.rays_of_point(cx.settings);
            let usual_rays = source.rays_of_point(&BakeSettings::for_error(error));
            let gathering = Gathering { level, area, rays, usual_rays, error };
            let may_restart = cx.settings.error.is_some() && rays == usual_rays;
            let more = if may_restart { emissions.rays_worth_while(&gathering) } else { None };
            if let Some(more) = more {
                tracing::debug!(more, "more rays let more surfaces glow");
                better = Some(cx.settings.clone().with_rays(f64::from(more)));
            } else {
                let glowing = emissions.glowing(&gathering);
                tracing::debug!(level, surfaces = glowing.len(), "surfaces glow");
                make_glow(&mut sources, &glowing);
                if let Some(pooled) = pool(&sources, area * median(&mesh.energies, &received), error) {
                    apart = Some(std::mem::replace(&mut sources, pooled));
                }
                let is_new = |source: &&LightSource| emissions.has(source) || source.origin == Origin::Lamps;
                let new: Vec<&LightSource> = sources.iter().filter(is_new).collect();
                let from_glowing = emissions.mean_irradiance(area, |surface| glowing.contains(&surface));
                better = light.add(cx, &new, from_glowing)?;
            }
        }
        if let Some(better) = better {
            let settings = BakeSettings { rows: source.strategy(), ..better };
            let mesh = ShootingMesh::again(mesh.mesh, longest_edge, &settings);
            cx.end_step("light");
            return Ok(ControlFlow::Break(NewStart { rows, settings, mesh }));
        }
        let variances = sources.iter().map(|source| light.variance(source)).collect();
        let sky_views: Vec<_> = light.light.iter_mut().map(|direct| direct.sky_views.take()).collect();
        let mut light = light.light.into_iter();
        if table.samples.is_some() {
            samples.set_direct(light.next().unwrap_or_default().all);
        }
        if table.middles.is_some() {
            middles.set_direct(light.next().unwrap_or_default().all);
        }
        let direct = light.next().unwrap_or_default();
        let direct = direct.map(|light| vertices.of_coarse(light));
        cx.end_step("light");
        mesh.preview(cx, &direct.all, || {
            let dark = vec![DVec3::ZERO; mesh.shares.len()];
            (direct.all.clone(), mesh.unshot(&values.of(&mesh.energies, &direct.all), &dark))
        });
        for (id, views) in ids.into_iter().zip(&sky_views) {
            views.iter().for_each(|views| source.see_sky(id, views));
        }
        let sources = Sources { all: sources, apart, variances };
        Ok(ControlFlow::Continue(Lit { mesh, rows, sources, samples, middles, direct }))
    }
}

/// The irradiance that half of the area gets no more than: a sun out of doors does not count within a house.
fn median(energies: &[ShareEnergy], received: &[DVec3]) -> DVec3 {
    let mut shares: Vec<(DVec3, f64)> =
        received.iter().zip(energies).map(|(light, share)| (*light, share.area)).collect();
    shares.sort_by(|a, b| a.0.element_sum().total_cmp(&b.0.element_sum()));
    let mut left = shares.iter().map(|(_, area)| area).sum::<f64>() / 2.0;
    let middle = shares.iter().find(|(_, area)| {
        left -= area;
        left <= 0.0
    });
    middle.map_or(DVec3::ZERO, |(light, _)| *light)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_by_area() {
        let share = |area: f64| ShareEnergy { receiver: 0, area, reflectance: DVec3::ZERO };
        let light = |light: f64| DVec3::new(0.0, light, 0.0);
        let of = |areas: &[f64], lights: &[f64]| {
            let energies: Vec<ShareEnergy> = areas.iter().map(|area| share(*area)).collect();
            median(&energies, &lights.iter().map(|own| light(*own)).collect::<Vec<_>>())
        };
        assert_eq!(of(&[], &[]), DVec3::ZERO);
        assert_eq!(of(&[1.0, 1.0, 1.0], &[9.0, 0.0, 2.0]), light(2.0));
        assert_eq!(of(&[5.0, 1.0, 1.0], &[9.0, 0.0, 2.0]), light(9.0));
        assert_eq!(of(&[1.0, 4.0, 1.0], &[9.0, 0.0, 2.0]), light(0.0));
    }
}
