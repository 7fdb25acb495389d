use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use anyhow::Context;
use clap::Args;
use rayon::ThreadPoolBuilder;
use scene::{ImportOptions, import};
use serde_json::{Value, json};
use view_factors::{Division, ViewFactorSettings, ViewFactors, view_factors};

use super::console::print;
use super::options::Unused;
use super::outputs::{check_distinct, write_output};
use super::progress::ProgressLine;
use super::report::new_table;
use super::scene_options::{BesideOptions, SceneOptions};
use super::workers::ThreadArguments;

/// Most points that a pair of polygons may be given for a form factor of 1.
const MOST_POINTS: i64 = 1 << 24;

#[derive(Args)]
pub struct FormFactorArguments {
    /// Scene: .glb or .gltf; needs no light
    scene: PathBuf,
    /// View factors to write: CSV of from, to, form_factor and standard_error
    ///
    /// Pairs with a view factor of 0 are left out.
    #[arg(short, long, value_name = "CSV")]
    output: PathBuf,
    /// Also write the surfaces: CSV of name, area, centroid, and open part and error of their row
    #[arg(long, value_name = "CSV")]
    areas: Option<PathBuf>,
    /// Also write all results to this JSON file
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Treat every polygon as a surface: NAME/0, NAME/1 and so on
    #[arg(long)]
    facets: bool,
    /// Sample points per pair of partly hidden polygons, at a form factor of 1
    ///
    /// Pairs with smaller form factors get proportionally fewer, at least 16. Four times as many at least halve the standard error.
    #[arg(long, value_name = "N", default_value_t = ViewFactorSettings::default().points,
        value_parser = clap::value_parser!(u32).range(1..=MOST_POINTS))]
    points: u32,
    /// Seed of these points
    #[arg(long, default_value_t = ViewFactorSettings::default().seed)]
    seed: u64,
    #[command(flatten)]
    pub threads: ThreadArguments,
    #[command(flatten)]
    options: SceneOptions<OfLight>,
    #[command(flatten)]
    beside: BesideOptions,
}

/// View factors do not depend on light.
struct OfLight;

impl Unused for OfLight {
    const FLAGS: &'static [&'static str] = &["sky", "light-unit"];
}

/// Computes the view factors of one scene.
pub fn run(arguments: &FormFactorArguments, threads: NonZeroUsize) -> anyhow::Result<()> {
    let clock = Instant::now();
    check_outputs(arguments)?;
    let options = arguments.beside.allow(arguments.options.import_options()?);
    let options = ImportOptions { needs_light: false, ..options };
    let line = ProgressLine::new("import");
    let scene = import(&arguments.scene, &options)?;
    for warning in &scene.warnings {
        line.say(format_args!("warning: {warning}"));
    }
    let division = if arguments.facets { Division::Facets } else { Division::Surfaces };
    let settings = ViewFactorSettings { division, points: arguments.points, seed: arguments.seed };
    let pool = ThreadPoolBuilder::new().num_threads(threads.get()).build();
    let pool = pool.context("threads cannot be started: give fewer --threads")?;
    let done = AtomicU64::new(0);
    let decided = |more: u64, all: u64| {
        let done = done.fetch_add(more, Ordering::Relaxed) + more;
        line.show_part("factors", (done, all), "pairs");
    };
    line.restart();
    let factors = pool
        .install(|| view_factors(&scene, &settings, &decided))
        .with_context(|| format!("{} has no view factors", arguments.scene.display()))?;
    line.enter("write");
    write_output(&arguments.output, |out| pool.install(|| factors.write_factors(out)))?;
    if let Some(path) = &arguments.areas {
        write_output(path, |out| factors.write_areas(out))?;
    }
    let seconds = clock.elapsed().as_secs_f64();
    if let Some(path) = &arguments.report {
        let text = serde_json::to_string_pretty(&report(&factors, &settings, seconds))?;
        write_output(path, |out| writeln!(out, "{text}"))?;
    }
    line.finish();
    print_table(&factors, seconds)
}

/// Nothing is computed that could not be written, and nothing is written over the scene or another output.
fn check_outputs(arguments: &FormFactorArguments) -> anyhow::Result<()> {
    let written = [
        ("output", Some(&*arguments.output)),
        ("list of areas", arguments.areas.as_deref()),
        ("report", arguments.report.as_deref()),
    ];
    check_distinct(&[("scene", Some(&arguments.scene))], &written)?;
    for (_, output) in written {
        output.map_or(Ok(()), files::check)?;
    }
    Ok(())
}

fn report(factors: &ViewFactors, settings: &ViewFactorSettings, seconds: f64) -> Value {
    let corrected = factors.most_corrected().filter(|row| row.correction != 0.0);
    json!({
        "surfaces": factors.rows.len(),
        "polygons": factors.polygons,
        "factors": factors.factors(),
        "pairs": factors.counts,
        "closed_rows": factors.closed_rows,
        "largest_correction": corrected.map_or(0.0, |row| row.correction.abs()),
        "largest_correction_surface": corrected.map(|row| &row.name),
        "largest_standard_error": factors.largest_standard_error(),
        "settings": settings,
        "seconds": seconds,
    })
}

fn print_table(factors: &ViewFactors, seconds: f64) -> anyhow::Result<()> {
    let counts = &factors.counts;
    let mut table = new_table();
    let mut row = |name: &str, value: String| {
        table.add_row([name.to_owned(), value]);
    };
    row("time", format!("{seconds:.2} s"));
    row("surfaces", format!("{} ({} polygons)", factors.rows.len(), factors.polygons));
    row("factors", factors.factors().to_string());
    row(
        "pairs of polygons",
        format!(
            "{} exact, {} estimated, {} hidden ({} as far as their points tell), {} turned away",
            counts.exact, counts.estimated, counts.hidden, counts.found_hidden, counts.turned_away
        ),
    );
    row("largest standard error of a row", format!("{:.2e}", factors.largest_standard_error()));
    row("closed rows", factors.closed_rows.to_string());
    let corrected = factors.most_corrected().filter(|row| row.correction != 0.0);
    let correction = |row: &view_factors::Row| format!("{:.2e} ({})", row.correction, row.name);
    row("largest correction of a row", corrected.map_or("none".to_owned(), correction));
    print(&table)
}
