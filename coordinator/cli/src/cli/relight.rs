use std::path::PathBuf;

use bake::{BakeSettings, LightChange, NewLight};
use clap::Args;
use cluster::metrics::Metrics;
use output::export::check_writable;
use pipeline::relight::{RelightRequest, Relighted};
use pipeline::run::SceneSource;

use super::console::print;
use super::output_options::OutputOptions;
use super::outputs::{check_distinct, check_report};
use super::progress::Shown;
use super::scene_options::{BesideOptions, SceneOptions, radiance};

#[derive(Args)]
pub struct RelightArguments {
    /// Scene that was baked: .glb or .gltf
    scene: PathBuf,
    /// Light of its sources, as written by `solve --keep-light`
    #[arg(long, value_name = "FILE")]
    kept: PathBuf,
    /// Lit scene to write: .glb, .gltf or .ply
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Multiply a light by these factors, or all channels by one (repeatable)
    ///
    /// Lights are named by their node; emissive surfaces by their node or material.
    #[arg(long = "light", value_name = "NAME=R,G,B", value_parser = change)]
    lights: Vec<LightChange>,
    /// Write all results to this JSON file
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// As in the bake, except --sky: the radiance of the new sky; under an image, its mean
    #[command(flatten)]
    options: SceneOptions,
    #[command(flatten)]
    beside: BesideOptions,
    #[command(flatten)]
    written: OutputOptions,
}

/// Relights one file.
pub fn run(arguments: &RelightArguments) -> anyhow::Result<()> {
    check_writable(&arguments.output)?;
    if arguments.written.lightmap()?.is_some() {
        anyhow::bail!("--lightmap: a relight writes light at vertices; bake the scene again for a lightmap");
    }
    if arguments.written.occlusion()?.is_some() {
        anyhow::bail!("--occlusion: a relight has no geometry to look at; bake the scene again");
    }
    if arguments.written.probes()?.is_some() {
        anyhow::bail!("--probes: a relight has light at vertices only; bake the scene again for probes");
    }
    if let Some(report) = &arguments.report {
        check_report(report)?;
    }
    check_distinct(
        &[
            ("scene", Some(&arguments.scene)),
            ("kept light", Some(&arguments.kept)),
            ("sky", arguments.options.sky_path()),
        ],
        &[("output", Some(&arguments.output)), ("report", arguments.report.as_deref())],
    )?;
    let (settings, export) =
        arguments.written.settings(&arguments.options.options(), BakeSettings::default())?;
    let request = RelightRequest {
        scene: SceneSource::File(&arguments.scene),
        import: arguments.beside.allow(arguments.options.import_options()?),
        kept_light: &arguments.kept,
        light: NewLight {
            changes: arguments.lights.clone(),
            sky: arguments.options.sky("give the new radiance, or bake anew")?,
            only: settings.only,
            groups: settings.groups,
        },
        export,
        output: &arguments.output,
        report: arguments.report.as_deref(),
    };
    let Relighted { seconds, report, .. } =
        pipeline::relight::run(request, &mut Shown::new(&Metrics::default()))?;
    print(format_args!(
        "relit {} vertices in {seconds:.2} s; estimated error {:.2} % (as baked {:.2} %)",
        report.vertices,
        100.0 * report.error.total,
        100.0 * report.error_as_baked.total
    ))
}

/// `NAME=R,G,B` or `NAME=NUMBER`.
pub fn change(text: &str) -> Result<LightChange, String> {
    // A name may have an equals sign in it, a number has none.
    let (light, factor) = text.rsplit_once('=').ok_or("must be NAME=R,G,B or NAME=NUMBER")?;
    let factor = match factor.trim().parse::<f64>() {
        Ok(number) => radiance(&format!("{number},{number},{number}"))?,
        Err(_) => radiance(factor)?,
    };
    Ok(LightChange { light: light.to_owned(), factor })
}
