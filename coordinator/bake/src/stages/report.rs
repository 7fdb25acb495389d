//! The metrics of a bake.

use serde::Serialize;

use super::light::SourceCounts;
use super::measure::Measured;
use super::solved::Solved;
use crate::context::Context;
use crate::error_budget::ErrorBudget;
use crate::observer::TimeParts;
use crate::settings::RowStrategy;
use crate::solver::balance::{EnergyBalance, RowSums};

/// Row sums over this are worth a warning.
const LARGEST_ROW_SUM: f64 = 1.01;

/// The metrics of a bake.
#[derive(Debug, Clone, Serialize)]
pub struct BakeReport {
    /// Vertices of the refined mesh.
    pub vertices: usize,
    /// Vertices that shoot.
    pub shooting_vertices: usize,
    /// Patches of the refined mesh.
    pub patches: usize,
    /// Surfaces that can block light.
    pub occluders: usize,
    /// How form factors were computed.
    pub row_strategy: RowStrategy,
    /// Rows made, each over all receivers of a set.
    pub rows: u64,
    /// Rows made again because they were not kept.
    pub rows_again: u64,
    /// Most bytes of rows that were ever kept.
    pub row_bytes: usize,
    /// Parts of the model that the scene needed.
    pub model: Model,
    /// Form factors computed that are not 0 before occlusion.
    pub factors: u64,
    /// Form factors that are not 0 after occlusion, in all rows, those made again included.
    pub visible_factors: u64,
    /// Rays cast.
    pub rays: u64,
    /// Shots.
    pub shots: u64,
    /// Finishing sweeps.
    pub sweeps: u32,
    /// Rounds of refinement.
    pub refinement_rounds: u32,
    /// Bound of the missing flux: unshot over reflected flux, times rho / (1 - rho).
    pub unshot_bound: f64,
    /// Estimated relative L2 error of the radiosity, by origin.
    pub error: ErrorBudget,
    /// Restarts with finer shooters or more rays, to meet the error, or to spare rows of light sources.
    pub restarts: u32,
    /// Energy balance.
    pub balance: EnergyBalance,
    /// How much of their hemisphere the shooting vertices see covered.
    pub row_sums: RowSums,
    /// Seconds of computing, summed over all threads of workers.
    pub busy_seconds: f64,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Seconds of each step.
    pub seconds: Vec<(&'static str, f64)>,
    /// How the wall time divides.
    #[serde(skip)]
    pub time: TimeParts,
    /// [`TimeParts::own`] by steps.
    #[serde(skip)]
    pub own_seconds: Vec<(&'static str, f64)>,
}

/// Parts of the model that a scene needed. A pair is a receiver and a polygon that sends light, or a light without area.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Model {
    /// Channels of light: 1 where all light has one colour and all surfaces are grey, else 3.
    pub channels: usize,
    /// Rows of emitting facets and of area lights; a surface whose light is gathered counts once, and small lamps may share rows.
    pub area_lights: usize,
    /// Point lights, each with a row of solid angles.
    pub point_lights: usize,
    /// Spot lights, each with a row.
    pub spot_lights: usize,
    /// Directional lights, each with a row of cosines.
    pub directional_lights: usize,
    /// Rows of the sky; 0 without a sky.
    pub sky: usize,
    /// All pairs.
    pub pairs: u64,
    /// Pairs in one plane or turned away from each other: no form factor.
    pub pairs_turned_away: u64,
    /// Pairs without occluders: form factor without visibility.
    pub pairs_unoccluded: u64,
    /// Pairs with occluders, whose visibility was computed exactly.
    pub pairs_computed: u64,
    /// Pairs with so many occluders that their visibility was sampled with rays.
    pub pairs_sampled: u64,
}

impl Measured {
    /// The metrics so far.
    pub fn report(&self, cx: &Context, occluders: usize) -> BakeReport {
        let monitor = &cx.client.monitor;
        let statistics = &monitor.statistics;
        let Solved { mesh, rows, solution, .. } = &self.solved;
        let areas = mesh.energies.iter().map(|share| share.area);
        let sums: Vec<(f64, f64)> = self.solved.row_sums.iter().copied().zip(areas).collect();
        let row_sums = RowSums::new(&sums);
        let balance = self.solved.balance(cx);
        BakeReport {
            warnings: self.warnings(cx, &row_sums, &balance),
            vertices: mesh.mesh.vertices.len(),
            shooting_vertices: mesh.shares.len(),
            patches: mesh.mesh.leaves().count(),
            occluders,
            row_strategy: rows.source.strategy(),
            rows: monitor.rows_made(),
            rows_again: monitor.rows_again,
            row_bytes: rows.table.most_bytes,
            model: self.model(cx),
            factors: statistics.factors,
            visible_factors: monitor.visible_factors,
            rays: statistics.rays,
            shots: cx.work.shots,
            sweeps: cx.work.sweeps,
            refinement_rounds: cx.work.rounds,
            unshot_bound: solution.unshot_bound,
            error: self.error,
            restarts: cx.work.restarts,
            balance,
            row_sums,
            busy_seconds: statistics.busy_nanoseconds as f64 * 1e-9,
            seconds: cx.work.seconds.clone(),
            time: monitor.time(),
            own_seconds: cx.work.own_seconds.clone(),
        }
    }

    fn model(&self, cx: &Context) -> Model {
        let statistics = &cx.client.monitor.statistics;
        let sources = SourceCounts::new(cx.scene, &self.solved.sources.all);
        Model {
            channels: cx.channels.count(),
            area_lights: sources.area,
            point_lights: sources.point,
            spot_lights: sources.spot,
            directional_lights: sources.directional,
            sky: sources.sky,
            pairs: statistics.pairs,
            pairs_turned_away: statistics.pairs - statistics.factors,
            pairs_unoccluded: statistics.factors - statistics.occluded_pairs,
            pairs_computed: statistics.occluded_pairs - statistics.sampled_pairs,
            pairs_sampled: statistics.sampled_pairs,
        }
    }

    fn warnings(&self, cx: &Context, row_sums: &RowSums, balance: &EnergyBalance) -> Vec<String> {
        let settings = cx.settings;
        let mut warnings = vec![];
        warnings.extend(self.describe_obstacle(cx));
        warnings.extend(self.describe_imbalance(cx, balance));
        let bounds = &self.solved.rows.table.bounds;
        let largest = row_sums.largest.max(bounds.largest_sum());
        if largest > LARGEST_ROW_SUM {
            let sums = self.solved.row_sums.iter().zip(&self.solved.mesh.shares);
            let worst = sums.max_by(|a, b| a.0.total_cmp(b.0));
            let place =
                worst.map_or("", |(_, share)| cx.scene.surfaces[share.surface as usize].name.as_str());
            warnings.push(format!(
                "form factors of {} vertices sum to more than 1, up to {largest:.4}, most on {place}: their light is scaled down, and \
                 the estimated error does not count that; surfaces overlap, or smooth normals bend far",
                bounds.count(),
            ));
        }
        let unshot = self.solved.solution.unshot_bound;
        if unshot > settings.threshold {
            warnings.push(format!("the sweeps left {unshot:.1e} of the reflected flux unshot"));
        }
        warnings
    }
}
