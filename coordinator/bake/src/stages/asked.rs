//! Light at points that somebody asks about, such as the texels of a lightmap and probes.

use glam::DVec3;
use kernel::replica::{Receiver, Receivers};

use super::even_light::EvenLight;
use super::glow::glow;
use super::irradiance::{Irradiance, Lights, Place, Received, irradiance_at};
use super::layers::Layer;
use super::solved::Solved;
use crate::context::Context;
use crate::error::Result;
use crate::mesh::along_curve;
use crate::observer::Phase;
use crate::solver::bounds::Bounds;

/// Points of which rows are under way at a time.
const AT_ONCE: usize = 1 << 16;

/// Points between others for each that is computed all the same, about: from two to eight were seen.
const MEANS_PER_ROW: usize = 4;

/// Points whose light is wanted beside that of the mesh.
#[derive(Debug, Clone, Copy, Default)]
pub struct AskedPoints<'a> {
    /// Points of the scene's surfaces, such as texels: light between them may be interpolated as that of vertices is.
    pub on_surfaces: &'a [Receiver],
    /// For each of these that lies between others, four of them, which come before it: where light is even there, their mean is its
    /// own. The first lies opposite the second, the third opposite the fourth. Where this is empty, each point has light of its own.
    pub around: &'a [Option<[u32; 4]>],
    /// Points anywhere in its space.
    pub in_space: &'a [Receiver],
    /// Whether the mesh is wanted for its brightness only: it is then left as it was solved on.
    pub without_mesh: bool,
}

/// Irradiance at the points that were asked about: the part that the settings want, then each group's.
#[derive(Debug, Clone, Default)]
pub struct PointLight {
    /// Of [`AskedPoints::on_surfaces`].
    pub on_surfaces: Vec<Vec<DVec3>>,
    /// Of [`AskedPoints::in_space`].
    pub in_space: Vec<Vec<DVec3>>,
}

/// A sort of points.
struct Sort {
    /// Key of the first point as a receiver: above those of all others.
    first_key: u64,
    /// Whether their light may be interpolated between gather points.
    may_interpolate: bool,
    phase: Phase,
}

impl Sort {
    /// Where rows ask for some of the points.
    fn place<'a>(&self, points: &'a Receivers) -> Place<'a> {
        if self.may_interpolate { Place::Many(points) } else { Place::Once(points) }
    }
}

const ON_SURFACES: Sort = Sort { first_key: 1 << 39, may_interpolate: true, phase: Phase::Lightmap };

const IN_SPACE: Sort = Sort { first_key: 1 << 40, may_interpolate: false, phase: Phase::Probes };

impl Solved {
    /// Irradiance at all points that are asked about.
    #[tracing::instrument(skip_all)]
    pub fn light_at(
        &mut self,
        cx: &mut Context,
        asked: &AskedPoints,
        layers: &[Layer],
    ) -> Result<PointLight> {
        let AskedPoints { on_surfaces, around, in_space, .. } = *asked;
        Ok(PointLight {
            on_surfaces: self.light_of(cx, (on_surfaces, around), &ON_SURFACES, layers)?,
            in_space: self.light_of(cx, (in_space, &[]), &IN_SPACE, layers)?,
        })
    }

    fn light_of(
        &mut self,
        cx: &mut Context,
        (points, around): (&[Receiver], &[Option<[u32; 4]>]),
        sort: &Sort,
        layers: &[Layer],
    ) -> Result<Vec<Vec<DVec3>>> {
        let mut light = vec![vec![DVec3::ZERO; points.len()]; 1 + layers.len()];
        if points.is_empty() {
            return Ok(light);
        }
        cx.client.monitor.enter(sort.phase, self.mesh.mesh.vertices.len());
        if sort.may_interpolate {
            self.expect(cx, (points, around))?;
        }
        let waves = waves(points.len(), around);
        let even =
            if waves.len() > 1 { Some(EvenLight::new(self, cx, (points, around), layers)?) } else { None };
        let (mut first_key, mut computed) = (sort.first_key, 0);
        for wave in waves {
            let mut own = match &even {
                Some(even) => even.take_means(cx, &wave, &mut light)?,
                None => wave,
            };
            computed += own.len();
            // Rows over neighbours in one plane cost least.
            own.sort_by_cached_key(|point| (points[*point].plane.0, along_curve(points[*point].position)));
            for some in own.chunks(AT_ONCE) {
                self.compute(cx, (points, some), (sort, first_key), layers, &mut light)?;
                first_key += AT_ONCE as u64;
            }
        }
        let between = around.iter().flatten().count();
        tracing::debug!(points = points.len(), between, computed, "{}", sort.phase.name());
        cx.end_step(sort.phase.name());
        Ok(light)
    }

    /// Lets rows be got ready for points, of which those that lie between none tell where they are.
    fn expect(
        &mut self,
        cx: &mut Context,
        (points, around): (&[Receiver], &[Option<[u32; 4]>]),
    ) -> Result<()> {
        let lies_alone = |index: usize| around.get(index).is_none_or(Option::is_none);
        let alone = points.iter().enumerate().filter(|(index, _)| lies_alone(*index));
        let alone: Vec<Receiver> = alone.map(|(_, point)| *point).collect();
        let glow = glow(&self.mesh, &self.sources.all);
        let light = (self.solution.radiosity().shares, glow.as_deref());
        let count = alone.len() + (points.len() - alone.len()) / MEANS_PER_ROW;
        self.rows.source.expect_many(cx, &self.mesh, (count, &alone), light)
    }

    /// Computes the light of some of the points.
    fn compute(
        &mut self,
        cx: &mut Context,
        (points, some): (&[Receiver], &[usize]),
        (sort, first_key): (&Sort, u64),
        layers: &[Layer],
        light: &mut [Vec<DVec3>],
    ) -> Result<()> {
        let receivers = some.iter().map(|point| points[*point]).collect();
        let receivers = Receivers { first_key, receivers };
        let whole = Lights { sources: &self.sources.all, radiosity: self.solution.radiosity() };
        let of_layers =
            layers.iter().map(|layer| Lights { sources: &layer.sources, radiosity: layer.radiosity() });
        let lights: Vec<Lights> = [whole].into_iter().chain(of_layers).collect();
        let place = sort.place(&receivers);
        let Received { light: found, cover } = irradiance_at(cx, &self.mesh, &mut self.rows, place, &lights)?;
        let mut bounds = Bounds::default();
        bounds.add(&cover.sums);
        for (light, Irradiance { mut direct, mut all, .. }) in light.iter_mut().zip(found) {
            bounds.apply(0, &mut direct.all);
            bounds.apply(0, &mut all);
            let wanted = cx.settings.only.of_all(&all, &direct.all);
            some.iter().zip(wanted).for_each(|(point, wanted)| light[*point] = wanted);
        }
        Ok(())
    }
}

/// Points in waves: those of each lie between points of earlier ones.
fn waves(points: usize, around: &[Option<[u32; 4]>]) -> Vec<Vec<usize>> {
    let mut wave_of: Vec<usize> = vec![];
    let mut waves: Vec<Vec<usize>> = vec![];
    for point in 0..points {
        let others = around.get(point).copied().flatten();
        let wave = others.map_or(0, |others| {
            1 + others.into_iter().map(|other| wave_of[other as usize]).max().unwrap_or_default()
        });
        wave_of.push(wave);
        waves.resize_with(waves.len().max(wave + 1), Vec::new);
        waves[wave].push(point);
    }
    waves
}
