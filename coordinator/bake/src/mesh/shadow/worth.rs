//! Which lines are worth their vertices.
//!
//! Bisection leaves cells of some width w along a line of length L where the radiosity jumps by c, relative to its root mean square:
//! the interpolation's square error there is c^2 L w / 6. The fewest cells for an error e over the area A have w = 6 e^2 A / (c S)
//! with S the sum of c L over all lines: c L S / (6 e^2 A) cells along the line, each with its vertices and those of the patches
//! around it, which divide as well. A line is worth being an edge of the mesh where that is more than an edge costs.

use foldhash::{HashMap, HashMapExt};

use glam::{DVec3, I64Vec3};
use kernel::disjoint_sets::DisjointSets;
use kernel::geometry::{area_vector, uniform_point};
use kernel::occluder::Occluder;
use rayon::prelude::*;
use scene::Scene;
use sobol_burley::sample_4d;

use super::ends::length;
use super::source::Source;
use super::{Line, facet_at};

/// Vertices that bisection spends on a cell: measured, see docs/method.md.
const PER_CELL: f64 = 18.0;

/// Vertices that bisection must spend on each line of a chain, in the mean.
const LEAST_SAVED: f64 = 4.0;

/// Most lines of a scene.
const MOST: usize = 4096;

/// Most lines of a facet.
const MOST_PER_FACET: usize = 256;

/// Ends this near to each other, in frame units, join their lines to a chain.
const JOINED: f64 = 2e-3;

/// Points at which the level of the light is estimated.
const POINTS: usize = 512;

/// The lines that are worth their vertices where the bake is to have this relative error. Those that save the most come first.
pub fn worth_it(
    scene: &Scene,
    sources: &[Source],
    occluder: &Occluder,
    lines: Vec<Line>,
    error: f64,
) -> Vec<Line> {
    if lines.is_empty() {
        return lines;
    }
    let Some(level) = Level::new(scene, sources, occluder) else { return vec![] };
    // Contrast times length.
    let weights: Vec<f64> = lines
        .iter()
        .map(|line| {
            (scene.surfaces[line.facet.0].reflectance * line.jump).length() / level.radiosity * length(line)
        })
        .collect();
    let per_weight = PER_CELL * weights.iter().sum::<f64>() / (6.0 * error * error * level.area);
    let chains = chains(&lines);
    let mut sums: HashMap<usize, (f64, f64)> = HashMap::new();
    for (chain, weight) in chains.iter().zip(&weights) {
        let sum = sums.entry(*chain).or_default();
        *sum = (sum.0 + weight * per_weight, sum.1 + 1.0);
    }
    let mean = |chain: &usize| sums[chain].0 / sums[chain].1;
    let mut order: Vec<usize> =
        (0..lines.len()).filter(|index| mean(&chains[*index]) >= LEAST_SAVED).collect();
    // Whole chains, the best first, and in them the longest lines.
    let key = |index: usize| (mean(&chains[index]), chains[index], weights[index], index);
    order.sort_by(|a, b| {
        let (a, b) = (key(*a), key(*b));
        b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)).then(b.2.total_cmp(&a.2)).then(a.3.cmp(&b.3))
    });
    let mut per_facet: HashMap<(usize, usize), usize> = HashMap::new();
    order.retain(|index| {
        let count = per_facet.entry(lines[*index].facet).or_default();
        *count += 1;
        *count <= MOST_PER_FACET
    });
    order.truncate(MOST);
    let mut lines: Vec<Option<Line>> = lines.into_iter().map(Some).collect();
    order.into_iter().filter_map(|index| lines[index].take()).collect()
}

/// The chain of each line: the least index of the lines of its light that are joined to it end to end.
fn chains(lines: &[Line]) -> Vec<usize> {
    let mut joined = DisjointSets::new(lines.len());
    let mut at: HashMap<(usize, [i64; 3]), usize> = HashMap::new();
    for (index, line) in lines.iter().enumerate() {
        for end in line.ends {
            let cell = (end / JOINED).floor().as_i64vec3();
            let steps = || -1..=1_i64;
            for step in
                steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| I64Vec3::new(x, y, z))))
            {
                if let Some(other) = at.get(&(line.source, (cell + step).to_array())) {
                    joined.join(index, *other);
                }
            }
            at.entry((line.source, cell.to_array())).or_insert(index);
        }
    }
    (0..lines.len()).map(|index| joined.representative(index)).collect()
}

/// What errors are relative to.
struct Level {
    /// Root mean square of the radiosity.
    radiosity: f64,
    /// Area of all facets.
    area: f64,
}

impl Level {
    /// Estimates it from the light of all sources at points spread over the facets, with as much light all around as these and
    /// emitting surfaces give in the mean. `None` where there is no light.
    fn new(scene: &Scene, sources: &[Source], occluder: &Occluder) -> Option<Self> {
        let mut area = 0.0;
        let mut places = vec![];
        let (mut emitted, mut reflectance) = (DVec3::ZERO, DVec3::ZERO);
        for (surface, own) in scene.surfaces.iter().enumerate() {
            for (index, facet) in own.lit_facets() {
                let corners: Vec<DVec3> = facet.positions().collect();
                let part = area_vector(&corners).length();
                area += part;
                emitted += own.exitance * part;
                reflectance += own.reflectance * part;
                places.push(((surface, index), area));
            }
        }
        let light_at = |index: usize| {
            let [x, y, z, _] = sample_4d(index as u32, 0, 0).map(f64::from);
            let (place, _) =
                places[places.partition_point(|(_, end)| *end <= x * area).min(places.len() - 1)];
            let facet = facet_at(scene, place);
            let corners: Vec<DVec3> = facet.positions().collect();
            let point = uniform_point(&corners, y, z);
            let light = |source: &Source| {
                let irradiance = source.irradiance(point, facet.normal);
                let is_dark = irradiance == DVec3::ZERO || source.is_hidden(occluder, point, facet.plane);
                if is_dark { DVec3::ZERO } else { irradiance }
            };
            (scene.surfaces[place.0].reflectance, sources.iter().map(light).sum::<DVec3>())
        };
        if places.is_empty() {
            return None;
        }
        let lights: Vec<(DVec3, DVec3)> = (0..POINTS).into_par_iter().map(light_at).collect();
        let reflectance = reflectance / area;
        let reflected =
            lights.iter().map(|(reflectance, light)| *reflectance * *light).sum::<DVec3>() / POINTS as f64;
        let around = (reflected + emitted / area + std::f64::consts::PI * scene.sky) / (1.0 - reflectance);
        let square =
            |(reflectance, light): &(DVec3, DVec3)| (*reflectance * (*light + around)).length_squared();
        let radiosity = (lights.iter().map(square).sum::<f64>() / POINTS as f64).sqrt();
        (radiosity > 0.0 && radiosity.is_finite() && area > 0.0).then_some(Self { radiosity, area })
    }
}
