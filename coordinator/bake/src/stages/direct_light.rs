//! Light straight from its sources.

use std::cell::LazyCell;

use glam::DVec3;
use kernel::row::Row;

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
    /// Irradiance of the vertices of the shooting mesh.
    pub direct: Vec<DVec3>,
}

/// The light sources, and what their rows tell beside irradiance.
pub struct Sources {
    pub all: Vec<LightSource>,
    /// Variance of the row of each over the refinement samples, summed over it.
    pub variances: Vec<f64>,
    /// Flux that the shares stop straight from all sources, in frame units.
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
        let Self { mesh, mut rows, sources, mut samples, mut middles } = self;
        cx.client.monitor.enter(Phase::Light, mesh.mesh.vertices.len());
        let (mut from_lights, mut from_outside) = (DVec3::ZERO, DVec3::ZERO);
        let Rows { source, table } = &mut rows;
        let mut variances = vec![];
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
        let look = |set, source: &LightSource, row: &Row, variance| {
            if Some(set) == of_samples {
                variances.push(variance);
            }
            if set != of_vertices || matches!(source.origin, Origin::Surface(_)) {
                return;
            }
            let factors: Vec<f64> = vertices.of_coarse(row.to_dense().into_iter().map(f64::from).collect());
            let of_shares = values.of(&mesh.energies, &factors);
            let flux = stopped_area.iter().zip(of_shares).map(|(area, factor)| area * factor).sum::<f64>();
            *if source.is_outside { &mut from_outside } else { &mut from_lights } += source.strength * flux;
        };
        let mut light = light::irradiance_of(&sources, &sets, cx.client, look)?.into_iter();
        if table.samples.is_some() {
            samples.set_direct(light.next().unwrap_or_default());
        }
        if table.middles.is_some() {
            middles.set_direct(light.next().unwrap_or_default());
        }
        let direct = light.next().unwrap_or_default();
        let direct = vertices.of_coarse(direct);
        let of_shares = values.of(&mesh.energies, &direct);
        let received = stopped_area.iter().zip(of_shares).map(|(area, light)| *area * light).sum();
        cx.end_step("light");
        mesh.preview(cx, &direct, || {
            let dark = vec![DVec3::ZERO; mesh.shares.len()];
            (direct.clone(), mesh.unshot(&values.of(&mesh.energies, &direct), &dark))
        });
        let sources = Sources { all: sources, variances, received, from_lights, from_outside };
        Ok(Lit { mesh, rows, sources, samples, middles, direct })
    }
}
