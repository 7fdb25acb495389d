//! View factors between the surfaces of a scene, as thermal engineers call form factors: the part of the radiation that leaves one
//! surface and arrives on another, with occlusion.
//!
//! In: a scene. Out: a table of factors with their errors. It must not know workers, rows of a bake or lit files. Begin reading at
//! `pairs`.
//!
//! | file | contents |
//! |---|---|
//! | `surfaces` | the surfaces, and their polygons |
//! | `element` | a prepared polygon |
//! | `tree`, `shaft`, `pairs` | which polygons see each other at all, decided for whole clusters |
//! | `quadrature` | integration over a polygon |
//! | `exchange` | pairs without occluders |
//! | `sampling` | pairs that are partly hidden |
//! | `rows`, `openness`, `closing` | rows of surfaces that see nothing but surfaces sum to 1 |
//! | `table` | the factors as CSV |
//!
//! Everything is computed once for each pair, as the *exchange area* A F, which is the same from both sides: A_i F_ij =
//! A_j F_ji holds up to rounding.

mod closing;
mod element;
mod exchange;
mod openness;
mod pairs;
mod quadrature;
mod rows;
mod sampling;
mod shaft;
mod surfaces;
mod table;
#[cfg(test)]
mod tests;
mod tree;

use kernel::geometry::ConvexPolygon;
use kernel::occluder::Occluder;
use kernel::row::Precision;
use rayon::prelude::*;
use serde::Serialize;

pub use self::pairs::PairCounts;
pub use self::rows::Row;

use self::element::Element;
use self::pairs::{ElementPair, Found, Way};
use self::rows::finish;
use self::sampling::Sampling;
use self::shaft::Blocker;
use self::tree::Tree;
use bake::occluders::occluders;
use scene::Scene;

/// What stands in the place of a surface for the part of a row that arrives on none.
pub const OPEN: &str = "(open)";

/// The way to the pairs is divided into this many parts or more, whatever the number of threads.
const TASKS: usize = 4096;

/// What counts as a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Division {
    /// Each side of each primitive of each node.
    Surfaces,
    /// Each polygon of these.
    Facets,
}

/// How view factors are computed.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct ViewFactorSettings {
    /// What counts as a surface.
    pub division: Division,
    /// Points for a pair of partly hidden polygons, if their form factor were 1; others get their part of it, and 16 or more.
    pub points: u32,
    /// Seed of these points.
    pub seed: u64,
}

impl Default for ViewFactorSettings {
    fn default() -> Self {
        Self { division: Division::Surfaces, points: 16384, seed: 1 }
    }
}

/// Why there are no view factors.
#[derive(Debug, thiserror::Error)]
pub enum ViewFactorError {
    /// Factors could not be told apart.
    #[error("no surface has a name: name the nodes or meshes of the scene")]
    NoNames,
    /// The name stands for what is no surface.
    #[error(
        "a surface is called {OPEN}, which stands for the part of a row that sees no surface: give it another name"
    )]
    ReservedName,
}

/// Two surfaces that see each other, or one that sees itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExchangePair {
    /// Index of a surface.
    pub from: u32,
    /// Index of another, larger, or the same.
    pub to: u32,
    /// Exchange area, in squared file units: area of either times its form factor to the other.
    pub area: f64,
    /// Its variance.
    pub variance: f64,
}

/// All view factors of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewFactors {
    /// The surfaces.
    pub rows: Vec<Row>,
    /// The pairs with a factor, in ascending order.
    pub pairs: Vec<ExchangePair>,
    /// How the pairs of polygons were decided.
    pub counts: PairCounts,
    /// Polygons of all surfaces.
    pub polygons: usize,
    /// Surfaces that see nothing but surfaces: their rows were closed.
    pub closed_rows: usize,
}

impl ViewFactors {
    /// The row whose sum was corrected most.
    #[must_use]
    pub fn most_corrected(&self) -> Option<&Row> {
        self.rows.iter().max_by(|a, b| a.correction.abs().total_cmp(&b.correction.abs()))
    }

    /// The largest standard error of a row's sum, before closing.
    #[must_use]
    pub fn largest_standard_error(&self) -> f64 {
        self.rows.iter().map(|row| row.standard_error).fold(0.0, f64::max)
    }

    /// Number of factors above 0, both ways.
    #[must_use]
    pub fn factors(&self) -> usize {
        let seen = self.pairs.iter().filter(|pair| pair.area > 0.0);
        seen.map(|pair| if pair.from == pair.to { 1 } else { 2 }).sum()
    }
}

/// Computes the view factors of a scene, on the threads of the pool that this is called in; their number changes no bit of the
/// answer. `progress` gets the number of decided pairs of polygons, and of all.
///
/// # Errors
/// When no surface has a name, or one has a name that it must not have.
pub fn view_factors(
    scene: &Scene,
    settings: &ViewFactorSettings,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> Result<ViewFactors, ViewFactorError> {
    let surfaces = surfaces::named(scene, settings.division)?;
    let unit = scene.frame.scale * scene.frame.scale;
    let elements: Vec<Element> = surfaces
        .par_iter()
        .enumerate()
        .flat_map_iter(|(index, surface)| {
            surface.polygons.iter().map(move |polygon| Element::new(index as u32, polygon.clone()))
        })
        .collect();
    let (found, counts) = element_pairs(scene, &elements, settings, progress);
    let mut pairs = surface_pairs(found, &elements);
    for pair in &mut pairs {
        pair.area *= unit;
        pair.variance *= unit * unit;
    }
    let mut rows: Vec<Row> = surfaces
        .into_iter()
        .map(|surface| Row {
            area: surface.polygons.iter().map(ConvexPolygon::area).sum::<f64>() * unit,
            centre: scene.frame.to_world(surfaces::centre(&surface.polygons)),
            name: surface.name,
            open: 0.0,
            standard_error: 0.0,
            correction: 0.0,
        })
        .collect();
    let closed_rows = finish(&mut rows, &mut pairs, &elements, scene, settings.seed);
    Ok(ViewFactors { rows, pairs, counts, polygons: elements.len(), closed_rows })
}

/// The pairs of elements that see each other. The same in every run: the parts of the way and their order do not depend on threads.
fn element_pairs(
    scene: &Scene,
    elements: &[Element],
    settings: &ViewFactorSettings,
    progress: &(dyn Fn(u64, u64) + Sync),
) -> (Vec<ElementPair>, PairCounts) {
    let polygons = occluders(scene).polygons;
    let blockers: Vec<Blocker> = polygons.iter().map(Blocker::new).collect();
    let precision = Precision { form_factor_error: 0.0, seed: settings.seed, ..Precision::DEFAULT };
    let way = Way {
        elements,
        tree: &Tree::new(elements),
        blockers: &blockers,
        occluder: &Occluder::new(&polygons),
        precision: &precision,
        sampling: Sampling { points: settings.points, seed: settings.seed },
    };
    let count = elements.len() as u64;
    let all = count * count.saturating_sub(1) / 2;
    let mut first = Found::default();
    let tasks = way.tasks(TASKS, &mut first);
    progress(first.counts.all, all);
    let run = |task| {
        let found = way.run(task);
        progress(found.counts.all, all);
        found
    };
    let parts: Vec<Found> = tasks.par_iter().map(run).collect();
    let mut counts = first.counts;
    let mut pairs = Vec::with_capacity(parts.iter().map(|part| part.pairs.len()).sum());
    for part in parts {
        counts += part.counts;
        pairs.extend(part.pairs);
    }
    (pairs, counts)
}

/// Adds up the pairs of elements of the same two surfaces, in the order of the elements.
fn surface_pairs(mut found: Vec<ElementPair>, elements: &[Element]) -> Vec<ExchangePair> {
    let surface = |element: u32| elements[element as usize].surface;
    // Elements stand in the order of their surfaces, and the first of a pair comes first.
    let key = |pair: &ElementPair| (surface(pair.from), surface(pair.to), pair.from, pair.to);
    found.par_sort_unstable_by_key(key);
    let mut pairs: Vec<ExchangePair> = vec![];
    for pair in found {
        let (from, to) = (surface(pair.from), surface(pair.to));
        // What one part of a surface sends to another comes back too.
        let ways = if from == to { 2.0 } else { 1.0 };
        let (area, variance) = (ways * pair.area, ways * ways * pair.variance);
        match pairs.last_mut() {
            Some(last) if (last.from, last.to) == (from, to) => {
                last.area += area;
                last.variance += variance;
            }
            _ => pairs.push(ExchangePair { from, to, area, variance }),
        }
    }
    pairs
}
