//! From a scene to texels, and from their light to images.

use std::collections::BTreeSet;

use glam::DVec3;
use kernel::replica::Receiver;
use scene::Scene;
use serde::Serialize;

use crate::error::{LightmapError, MOST_TEXELS, Stop};
use crate::fill::{State, fill};
use crate::layout::SideLayout;
use crate::meetings::meetings;
use crate::own_set::own_set;
use crate::seams::{Equation, agree, equations};
use crate::sides::lit_sides;
use crate::texels::{NO_POINT, Texels, texels};
use crate::unwrap::{Pages, Resolution, area, check_size, unwrap};

/// Most texels of all pages, with what is between charts.
const MOST_IN_PAGES: u64 = 4 * MOST_TEXELS;

/// Part of a page that charts fill, about.
const LIKELY_FILL: f64 = 0.5;

/// Light below this part of the mean is none, inside of something.
const DARK: f64 = 1e-3;

/// Texels of a lightmap, before their light is known.
pub struct Plan {
    pages: Pages,
    pub(crate) texels: Texels,
    pub(crate) borders: Vec<Equation>,
    report: PlanReport,
}

/// What a lightmap is made of.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlanReport {
    /// Columns and rows of a page.
    pub size: [u32; 2],
    /// Number of pages.
    pub pages: u32,
    /// Connected parts of the surfaces.
    pub charts: u32,
    /// Sides of surfaces that have the layout of another one, which has the same mesh.
    pub instances: usize,
    /// Edge of a texel, units of the file.
    pub texel_size: f64,
    /// Texels that surfaces cover.
    pub texels: usize,
    /// Those inside of other geometry, filled from their neighbours.
    pub hidden_texels: usize,
    /// Whether the coordinates are the input's second set.
    pub uses_second_set: bool,
    /// Why that set was not used, where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_set_problem: Option<String>,
}

/// Lays the surfaces of a scene out on pages, and finds the point of each texel. `stop` is asked often.
///
/// # Errors
/// When there would be too many texels, or `stop` returns true.
pub fn plan(scene: &Scene, resolution: Resolution, stop: Stop) -> Result<Plan, LightmapError> {
    let sides = lit_sides(scene);
    if let Resolution::Texel(texel) = resolution {
        check_size(area(scene, &sides), texel)?;
    }
    let texel = match resolution {
        Resolution::Texel(texel) => texel,
        Resolution::Page(page) => (area(scene, &sides) / LIKELY_FILL).sqrt() / f64::from(page),
    };
    let meetings = meetings(&sides, texel / scene.frame.scale, stop).ok_or(LightmapError::Cancelled)?;
    let own = own_set(scene, &sides, resolution);
    let (pages, uses_second_set, second_set_problem) = match own {
        Some(Ok(pages)) => (pages, true, None),
        Some(Err(problem)) => (unwrap(scene, &sides, &meetings, resolution, stop)?, false, Some(problem)),
        None => (unwrap(scene, &sides, &meetings, resolution, stop)?, false, None),
    };
    let [width, height] = pages.size.map(u64::from);
    if width * height * u64::from(pages.count) > MOST_IN_PAGES {
        let [width, height] = pages.size;
        let (count, charts) = (pages.count, pages.charts);
        return Err(LightmapError::Layout(format!(
            "{charts} charts need {count} x {width} x {height} texels"
        )));
    }
    let texels = texels(scene, &sides, &pages, stop)?;
    let borders = equations(&sides, &meetings, &pages);
    let report = PlanReport {
        size: pages.size,
        pages: pages.count,
        charts: pages.charts,
        instances: instances(&pages.layouts),
        texel_size: pages.texel,
        texels: texels.texels.len(),
        hidden_texels: texels.point_of.iter().filter(|point| **point == NO_POINT).count(),
        uses_second_set,
        second_set_problem,
    };
    Ok(Plan { pages, texels, borders, report })
}

/// How many layouts are those of others.
fn instances(layouts: &[SideLayout]) -> usize {
    let groups = layouts.iter().filter_map(|layout| layout.shared.as_ref()).map(|shared| shared.group);
    groups.clone().count() - groups.collect::<BTreeSet<_>>().len()
}

impl Plan {
    /// Points whose light is wanted.
    #[must_use]
    pub fn points(&self) -> &[Receiver] {
        &self.texels.points
    }

    /// For each point that lies between others, four of these, which come before it: where they and the surface are evenly lit, their
    /// mean light is its own. The first lies opposite the second, the third opposite the fourth; where there are two, each is there twice.
    #[must_use]
    pub fn around(&self) -> &[Option<[u32; 4]>] {
        &self.texels.around
    }

    /// What the lightmap is made of.
    #[must_use]
    pub fn report(&self) -> &PlanReport {
        &self.report
    }

    /// The lightmap, given the irradiance at its points in each layer.
    ///
    /// # Panics
    /// When a layer has fewer values than there are points.
    #[must_use]
    pub fn lightmap(self, layers: &[Vec<DVec3>]) -> Lightmap {
        let states = layers.first().map(|light| self.states(light)).unwrap_or_default();
        let images = layers.iter().map(|light| self.images(light, &states)).collect();
        let Self { pages: Pages { size, layouts, .. }, report, .. } = self;
        Lightmap { size, layouts, images, report }
    }

    /// What each texel of all pages is, given the whole light at its points.
    fn states(&self, light: &[DVec3]) -> Vec<State> {
        let [width, height] = self.pages.size.map(|side| side as usize);
        let mean = light.iter().map(|light| light.element_sum()).sum::<f64>() / light.len().max(1) as f64;
        let mut states = vec![State::Empty; width * height * self.pages.count as usize];
        let texels = self.texels.texels.iter().zip(&self.texels.point_of).zip(&self.texels.may_be_hidden);
        for ((texel, point), may_be_hidden) in texels {
            let is_dark = || light[*point as usize].element_sum() < DARK * mean;
            let is_hidden = *point == NO_POINT || (*may_be_hidden && is_dark());
            states[*texel as usize] = if is_hidden { State::Unknown } else { State::Known };
        }
        states
    }

    /// The pages of a layer.
    fn images(&self, light: &[DVec3], states: &[State]) -> Vec<Vec<[f32; 3]>> {
        let [width, height] = self.pages.size.map(|side| side as usize);
        let count = width * height;
        let mut all = vec![DVec3::ZERO; states.len()];
        for (texel, point) in self.texels.texels.iter().zip(&self.texels.point_of) {
            if states[*texel as usize] == State::Known {
                all[*texel as usize] = light[*point as usize];
            }
        }
        for (page, states) in all.chunks_mut(count).zip(states.chunks(count)) {
            fill(page, states, width);
        }
        agree(&mut all, &self.borders, |texel| states[texel as usize] == State::Known);
        let page = |page: &[DVec3]| page.iter().map(|light| light.as_vec3().to_array()).collect();
        all.chunks(count).map(page).collect()
    }
}

/// A lightmap: irradiance over the surfaces of a scene, as images.
#[derive(Debug, Clone, PartialEq)]
pub struct Lightmap {
    /// Columns and rows of each page.
    pub size: [u32; 2],
    /// The lit sides of the scene, laid out on the pages.
    pub layouts: Vec<SideLayout>,
    /// Irradiance by layer, page and texel, row by row from the top.
    pub images: Vec<Vec<Vec<[f32; 3]>>>,
    /// What it is made of.
    pub report: PlanReport,
}
