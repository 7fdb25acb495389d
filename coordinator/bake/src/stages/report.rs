//! The figures of a bake.

use glam::DVec3;
use serde::Serialize;

use super::light::SourceCounts;
use super::{Bake, ErrorBudget, RowStrategy};
use crate::solver::balance::{EnergyBalance, RowSums};

/// A vertex whose row sums to more than this is counted as enclosed: what its row lacks is error, not sky.
const ENCLOSED: f64 = 0.999;

/// A scene whose vertices see less than this of their hemisphere covered, in the mean, is open.
const OPEN: f64 = 0.99;

/// Row sums over this are worth a warning.
const LARGEST_ROW_SUM: f64 = 1.01;

/// The figures of a bake.
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
    /// Times that a row was made again, because it was not kept.
    pub rows_again: u64,
    /// Most bytes of rows that were ever kept.
    pub row_bytes: usize,
    /// What of the model the scene needed.
    pub model: Model,
    /// Form factors computed that are not 0 before occlusion.
    pub factors: u64,
    /// Form factors that are not 0 after occlusion, of all rows that came from workers, those made again included.
    pub visible_factors: u64,
    /// Rays cast.
    pub rays: u64,
    /// Shots.
    pub shots: u64,
    /// Finishing sweeps.
    pub sweeps: u32,
    /// Rounds of refinement.
    pub refinement_rounds: u32,
    /// Unshot flux at the end, relative to the reflected flux, times rho / (1 - rho): bound of what is missing.
    pub unshot_bound: f64,
    /// Estimated relative L2 error of the radiosity, by where it comes from.
    pub error: ErrorBudget,
    /// Times that the bake began again with finer shooters or more rays, because the error asked for needed them.
    pub restarts: u32,
    /// Where the energy went.
    pub balance: EnergyBalance,
    /// How much of their hemisphere the shooting vertices see covered.
    pub row_sums: RowSums,
    /// Seconds that workers computed, over all threads.
    pub busy_seconds: f64,
    /// What the user should know about the result.
    pub warnings: Vec<String>,
    /// Seconds of each step.
    pub seconds: Vec<(&'static str, f64)>,
}

/// What of the model a scene needed. A pair is a receiver and one polygon that sends light, or a light without an area.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Model {
    /// Channels of light: 1 where all light has one colour and all surfaces are grey, else 3.
    pub channels: usize,
    /// Emitting facets and area lights, each with a row of its own.
    pub area_lights: usize,
    /// Point lights, each with a row of solid angles.
    pub point_lights: usize,
    /// Spot lights, each with a row.
    pub spot_lights: usize,
    /// Directional lights, each with a row of cosines.
    pub directional_lights: usize,
    /// Polygons that the sky is made of, each with a row; 0 without a sky.
    pub sky: usize,
    /// All pairs.
    pub pairs: u64,
    /// Pairs in one plane or turned away from each other: no form factor.
    pub pairs_turned_away: u64,
    /// Pairs with nothing between: form factor without visibility.
    pub pairs_unoccluded: u64,
    /// Pairs with something between, whose visibility was computed.
    pub pairs_computed: u64,
    /// Pairs with so much between that their visibility was sampled with rays.
    pub pairs_sampled: u64,
}

impl Bake<'_, '_> {
    pub(super) fn report(&self) -> BakeReport {
        let statistics = &self.office.statistics;
        let areas = self.energies.iter().map(|share| share.area);
        let sums: Vec<(f64, f64)> = self.row_sums.iter().copied().zip(areas).collect();
        let row_sums = RowSums::new(&sums);
        BakeReport {
            warnings: self.warnings(&row_sums),
            vertices: self.mesh.vertices.len(),
            shooting_vertices: self.shares.len(),
            patches: self.mesh.leaves().count(),
            occluders: self.occluders,
            row_strategy: if self.is_gathered { RowStrategy::Gather } else { RowStrategy::Exact },
            rows: self.office.rows_made(),
            rows_again: self.office.rows_made_again(),
            row_bytes: self.most_row_bytes,
            model: self.model(),
            factors: statistics.factors,
            visible_factors: self.office.visible_factors(),
            rays: statistics.rays,
            shots: self.spent.shots,
            sweeps: self.spent.sweeps,
            refinement_rounds: self.spent.rounds,
            unshot_bound: self.unshot_bound,
            error: self.error,
            restarts: self.spent.restarts,
            balance: self.balance(),
            row_sums,
            busy_seconds: statistics.busy_nanoseconds as f64 * 1e-9,
            seconds: self.spent.seconds.clone(),
        }
    }

    fn model(&self) -> Model {
        let statistics = &self.office.statistics;
        let sources = SourceCounts::new(self.scene, &self.sources);
        Model {
            channels: self.channels.count(),
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

    /// True when light can leave the scene: then what a point light sends to no surface has escaped, where in a closed scene
    /// it is an error of the mesh. Shares that see next to nothing lie between surfaces and do not count.
    fn is_open(&self) -> bool {
        let seeing = self.row_sums.iter().zip(&self.energies).filter(|(sum, _)| **sum > 1.0 - ENCLOSED);
        let (covered, area) =
            seeing.fold((0.0, 0.0), |(c, a), (sum, share)| (c + sum.min(1.0) * share.area, a + share.area));
        covered < OPEN * area
    }

    fn warnings(&self, row_sums: &RowSums) -> Vec<String> {
        let mut warnings = vec![];
        warnings.extend(self.obstacle());
        if row_sums.largest > LARGEST_ROW_SUM {
            warnings.push(format!(
                "form factors of a vertex sum to {:.4}, more than 1: surfaces overlap, or smooth normals bend far",
                row_sums.largest
            ));
        }
        if self.unshot_bound > self.settings.threshold {
            warnings.push(format!("the sweeps left {:.1e} of the reflected flux unshot", self.unshot_bound));
        }
        warnings
    }

    pub(super) fn balance(&self) -> EnergyBalance {
        let square_unit = self.scene.frame.scale * self.scene.frame.scale;
        let surfaces = &self.scene.surfaces;
        let (mut emitted, mut absorbed, mut escaped) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for (id, patch) in self.mesh.leaves() {
            let surface = &surfaces[patch.surface as usize];
            let corners = patch.corners.iter().map(|corner| self.irradiance[corner.index()]);
            let mean = corners.sum::<DVec3>() / patch.corners.len() as f64;
            emitted += surface.exitance * patch.area;
            // The rest passes through.
            let look = self.patch_looks.of(self.scene, &self.mesh, id);
            absorbed += (look.opacity - look.reflectance) * mean * patch.area;
        }
        for (index, share) in self.shares.iter().enumerate() {
            if self.row_sums[index] < ENCLOSED {
                let leaving = self.looks[index].exitance + self.radiosity[index];
                escaped += leaving * share.area * (1.0 - self.row_sums[index]);
            }
        }
        let [emitted, absorbed, unshot, escaped] =
            [emitted, absorbed, self.unshot, escaped].map(|f| f * square_unit);
        let from_lights: DVec3 = self.scene.lights.iter().map(|light| light.flux(&self.scene.frame)).sum();
        let past = if self.is_open() { from_lights - self.from_lights * square_unit } else { DVec3::ZERO };
        let emitted = emitted + from_lights + self.from_outside * square_unit;
        EnergyBalance::new(emitted, absorbed, unshot, escaped + past.max(DVec3::ZERO))
    }
}
