use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use anyhow::Context;
use clap::Args;
use scene::ReadOptions;
use serde_json::json;
use verify::plain::{PlainOptions, PlainScene};
use verify::reference::{
    Agreement, MOST_PATHS, Place, ReferenceError, ReferencePoint, ReferenceSettings, locate, random, read,
    relative_standard_error, to_csv, trace,
};

use super::console::print;
use super::options::Unused;
use super::outputs::{check_distinct, write_output};
use super::progress::ProgressLine;
use super::scene_options::{BesideOptions, SceneOptions};
use super::workers::ThreadArguments;

#[derive(Args)]
pub struct ReferenceArguments {
    /// Scene to trace: .glb or .gltf
    scene: PathBuf,
    /// Reference to write: CSV of position, normal, primitive, radiosity and standard error
    #[arg(short, long, value_name = "CSV")]
    output: PathBuf,
    /// Random points, uniform over the area of the reflecting surfaces
    #[arg(long, value_name = "N", default_value = "4000", value_parser = at_least_one)]
    points: NonZeroUsize,
    /// Trace the points of this reference instead, and compare with it
    #[arg(long, value_name = "CSV", conflicts_with = "points")]
    at: Option<PathBuf>,
    /// Paths per point; four times as many halve the standard error
    #[arg(long, value_name = "N", default_value_t = ReferenceSettings::default().paths,
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_PATHS)))]
    paths: u32,
    /// Seed of points and paths
    #[arg(long, default_value_t = ReferenceSettings::default().seed)]
    seed: u64,
    #[command(flatten)]
    pub threads: ThreadArguments,
    #[command(flatten)]
    options: SceneOptions<Weld>,
    #[command(flatten)]
    beside: BesideOptions,
}

/// Paths are traced between the triangles of the file.
struct Weld;

impl Unused for Weld {
    const FLAGS: &'static [&'static str] = &["weld"];
}

fn at_least_one(text: &str) -> Result<NonZeroUsize, String> {
    text.parse().map_err(|_| "must be a whole number from 1".to_owned())
}

/// Traces one scene, and prints the figures of the result as one line of JSON.
pub fn run(arguments: &ReferenceArguments, threads: NonZeroUsize) -> anyhow::Result<()> {
    let clock = Instant::now();
    check_output(arguments)?;
    let options = arguments.options.import_options()?;
    let options = PlainOptions {
        read: ReadOptions { outside_files: arguments.beside.outside_files, ..options.read },
        light_unit: options.light_unit,
        sky: options.sky,
        sky_image: arguments.options.sky_image()?.map(Arc::new),
    };
    let line = ProgressLine::new("import");
    let scene = PlainScene::open_with(&arguments.scene, &options)?;
    for warning in &scene.warnings {
        line.say(format_args!("warning: {warning}"));
    }
    let failed = || format!("{} cannot be traced", arguments.scene.display());
    let other = arguments.at.as_ref().map(|path| Ok::<_, anyhow::Error>((path, read(path)?))).transpose()?;
    let places = match &other {
        Some((path, points)) => located(&scene, path, points)?,
        None => random(&scene, arguments.points.get(), arguments.seed).with_context(failed)?,
    };
    let settings = ReferenceSettings { paths: arguments.paths, seed: arguments.seed, threads: threads.get() };
    let done = AtomicU64::new(0);
    let traced = || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        line.show_part("trace", (done, places.len() as u64), "points");
    };
    line.restart();
    let points = trace(&scene, &places, &settings, &traced).with_context(failed)?;
    line.finish();
    write_output(&arguments.output, |out| out.write_all(to_csv(&points).as_bytes()))?;
    let mut figures = json!({
        "points": points.len(),
        "paths": arguments.paths,
        "relative_standard_error": relative_standard_error(&points),
        "seconds": clock.elapsed().as_secs_f64(),
    });
    if let Some((_, others)) = &other {
        let agreement = Agreement::of(&points, others);
        figures["agreement"] = json!({
            "within_3_sigma": agreement.within_3_sigma,
            "mean_sigma": agreement.mean_sigma,
            "rms_sigma": agreement.rms_sigma,
            "energy_ratio": agreement.energy_ratio,
            "energy_ratio_error": agreement.energy_ratio_error,
        });
    }
    print(&figures)
}

/// The places of another reference, on the surfaces of this scene.
fn located(scene: &PlainScene, path: &Path, points: &[ReferencePoint]) -> Result<Vec<Place>, ReferenceError> {
    let places: Vec<Place> = points.iter().map(|point| point.place).collect();
    let located = locate(scene, &places).into_iter().enumerate();
    located
        .map(|(index, place)| {
            place.ok_or_else(|| ReferenceError::OffScene {
                reference: path.to_owned(),
                point: index + 1,
                primitive: places[index].primitive,
            })
        })
        .collect()
}

/// Nothing is traced that could not be written, and nothing that is read is overwritten.
fn check_output(arguments: &ReferenceArguments) -> anyhow::Result<()> {
    let output = &arguments.output;
    check_distinct(
        &[
            ("scene", Some(&arguments.scene)),
            ("other reference", arguments.at.as_deref()),
            ("sky", arguments.options.sky_path()),
        ],
        &[("output", Some(output))],
    )?;
    Ok(files::check(output)?)
}
