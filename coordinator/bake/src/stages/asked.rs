//! Light at points that somebody asks about, such as the texels of a lightmap.

use glam::DVec3;
use kernel::replica::{Receiver, Receivers};

use super::irradiance::{Irradiance, Lights, Place, Received, irradiance_at};
use super::layers::Layer;
use super::solved::Solved;
use crate::context::Context;
use crate::error::Result;
use crate::mesh::along_curve;
use crate::observer::Phase;
use crate::solver::bounds::Bounds;

/// Key of the first point as a receiver: above those of all others.
const FIRST_KEY: u64 = 1 << 39;

/// Points of which rows are under way at a time.
const AT_ONCE: usize = 1 << 16;

impl Solved {
    /// Irradiance at some points: of the part of the light that is wanted, and of each group.
    #[tracing::instrument(skip_all)]
    pub fn light_at(
        &mut self,
        cx: &mut Context,
        points: &[Receiver],
        layers: &[Layer],
    ) -> Result<Vec<Vec<DVec3>>> {
        let mut light = vec![vec![DVec3::ZERO; points.len()]; 1 + layers.len()];
        if points.is_empty() {
            return Ok(light);
        }
        cx.client.monitor.enter(Phase::Lightmap, self.mesh.mesh.vertices.len());
        // Rows over neighbours in one plane cost least.
        let mut order: Vec<usize> = (0..points.len()).collect();
        order.sort_by_cached_key(|point| (points[*point].plane.0, along_curve(points[*point].position)));
        for (index, some) in order.chunks(AT_ONCE).enumerate() {
            let first_key = FIRST_KEY + (index * AT_ONCE) as u64;
            let receivers = some.iter().map(|point| points[*point]).collect();
            let receivers = Receivers { first_key, receivers };
            let whole = Lights { sources: &self.sources.all, radiosity: &self.solution.radiosity };
            let of_layers =
                layers.iter().map(|layer| Lights { sources: &layer.sources, radiosity: &layer.radiosity });
            let lights: Vec<Lights> = [whole].into_iter().chain(of_layers).collect();
            let Received { light: found, cover } =
                irradiance_at(cx, &self.mesh, &mut self.rows, Place::Many(&receivers), &lights)?;
            let mut bounds = Bounds::default();
            bounds.add(&cover.sums);
            for (light, Irradiance { mut direct, mut all }) in light.iter_mut().zip(found) {
                bounds.apply(0, &mut direct);
                bounds.apply(0, &mut all);
                let wanted = cx.settings.only.of_all(&all, &direct);
                some.iter().zip(wanted).for_each(|(point, wanted)| light[*point] = wanted);
            }
        }
        cx.end_step("lightmap");
        Ok(light)
    }
}
