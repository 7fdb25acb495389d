use bake::{BakeSettings, RowStrategy};
use clap::Args;
use pipeline::options::{Violations, bake_settings};
use protocol::api::{self, BakeOptions};

/// Knobs of the bake.
#[derive(Args)]
pub struct Knobs {
    /// Error to reach: relative L2 of the radiosity, for example 0.02. Picks mesh, rays and threshold, and goes on until the
    /// bake's own estimate meets it [default: none; the knobs below decide].
    #[arg(long, value_parser = error, conflicts_with_all = ["shooter_edge", "mesh_error"])]
    error: Option<f64>,
    /// How form factors are computed: `exact` visibility for every pair, or `gather` with rays over each receiver's hemisphere,
    /// for dense meshes.
    #[arg(long, value_name = "STRATEGY", default_value = "automatic", value_parser = row_strategy)]
    rows: RowStrategy,
    /// Longest edge of a shooting patch, relative to the scene's extent.
    #[arg(long, default_value_t = BakeSettings::default().shooter_edge, value_parser = proportion)]
    shooter_edge: f64,
    /// Interpolation error at which refinement ends: relative L2 of the radiosity.
    #[arg(long, default_value_t = BakeSettings::default().mesh_error, value_parser = positive)]
    mesh_error: f64,
    /// Longest edge of the output's triangles, in the file's units, as far as --max-vertices allows [default: none; light decides].
    #[arg(long, value_name = "LENGTH", value_parser = positive)]
    max_edge: Option<f64>,
    /// Refinement also ends at this number of vertices.
    #[arg(long, default_value_t = BakeSettings::default().max_vertices)]
    max_vertices: usize,
    /// Memory for rows, in MiB: those that do not fit are computed again when they are needed. No part of the answer.
    #[arg(long, value_name = "MIB", default_value_t = BakeSettings::default().row_cache)]
    row_cache: usize,
    /// The solution ends when rho / (1 - rho) x unshot flux is under this part of the reflected flux.
    /// [default: 1e-6; a hundredth of --error]
    #[arg(long, value_parser = positive)]
    threshold: Option<f64>,
    /// Shot n is chosen from the state after shot n - WINDOW. Part of the answer, whatever the workers.
    #[arg(long, default_value_t = BakeSettings::default().window as u32, value_parser = clap::value_parser!(u32).range(1..))]
    window: u32,
    /// Visibility through a shaft with more occluders than this is sampled with rays; that through others is computed exactly.
    #[arg(long, default_value_t = BakeSettings::default().exact_occluders)]
    exact_occluders: u32,
    /// Rays that a vertex spends on a hemisphere of such crowded shafts [default: 1024, or what --error needs].
    #[arg(long, value_parser = clap::value_parser!(u32).range(4..=262_144))]
    rays: Option<u32>,
    /// Relative error that a form factor may have before occlusion: distant polygons may then be taken for points.
    #[arg(long, default_value_t = BakeSettings::default().form_factor_error, value_parser = part)]
    form_factor_error: f64,
    /// Relative error to which each form factor may be rounded, so that rows take fewer bytes on their way from the workers.
    #[arg(long, default_value_t = BakeSettings::default().factor_rounding, value_parser = rounding)]
    factor_rounding: f64,
    /// Random points at which the answer is measured, at least. At 0 the error is predicted from the vertices alone.
    #[arg(long, alias = "check-points", default_value_t = BakeSettings::default().validation_samples as u64)]
    validation_samples: u64,
    /// Seed of all rays and of the validation samples.
    #[arg(long, default_value_t = BakeSettings::default().seed)]
    seed: u64,
    /// Weigh point lights by the cosine of a horizontal plane through them instead of evenly by solid angle.
    #[arg(long)]
    planar_point_lights: bool,
}

impl Knobs {
    /// The knobs as a service is told of them, the memory for rows aside: that is no part of the answer.
    pub fn options(&self) -> BakeOptions {
        // What --error chooses is not told: it has its defaults here.
        let unless_chosen = |value: f64| self.error.is_none().then_some(value);
        BakeOptions {
            error: self.error,
            mesh_error: unless_chosen(self.mesh_error),
            shooter_edge: unless_chosen(self.shooter_edge),
            max_edge: self.max_edge,
            max_vertices: Some(self.max_vertices as u64),
            rows: match self.rows {
                RowStrategy::Automatic => api::RowsOf::Unspecified,
                RowStrategy::Exact => api::RowsOf::Shooters,
                RowStrategy::Gather => api::RowsOf::Receivers,
            }
            .into(),
            threshold: self.threshold,
            window: Some(self.window),
            exact_occluders: Some(self.exact_occluders),
            rays: self.rays,
            form_factor_error: Some(self.form_factor_error),
            factor_rounding: Some(self.factor_rounding),
            check_points: Some(self.validation_samples),
            seed: Some(self.seed),
            planar_point_lights: self.planar_point_lights,
        }
    }

    /// The settings that the knobs ask for: those that a service would take them for.
    pub fn settings(&self) -> anyhow::Result<BakeSettings> {
        let mut wrong = Violations::default();
        let settings = bake_settings(&self.options(), &mut wrong);
        wrong.check()?;
        Ok(BakeSettings { row_cache: self.row_cache, ..settings })
    }
}

/// A positive number.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("must be a positive number".into()),
    }
}

fn error(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (1e-4..=0.5).contains(&value) => Ok(value),
        _ => Err("must be a part of the radiosity, from 0.0001 to 0.5: 0.02 is 2 %".into()),
    }
}

fn row_strategy(text: &str) -> Result<RowStrategy, String> {
    // The second names are those of before.
    match text {
        "automatic" | "suiting" => Ok(RowStrategy::Automatic),
        "exact" | "shooters" => Ok(RowStrategy::Exact),
        "gather" | "receivers" => Ok(RowStrategy::Gather),
        _ => Err("must be automatic, exact or gather".into()),
    }
}

fn part(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=0.5).contains(&value) => Ok(value),
        _ => Err("must be a number from 0 to 0.5".into()),
    }
}

fn rounding(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1e-3).contains(&value) => Ok(value),
        _ => Err("must be a number from 0 to 0.001".into()),
    }
}

fn proportion(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (1e-3..=1.0).contains(&value) => Ok(value),
        _ => Err("must be a number from 0.001 to 1".into()),
    }
}
