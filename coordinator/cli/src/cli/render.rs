use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use clap::{Args, ValueEnum};
use cluster::{Cluster, ClusterSettings};
use glam::DVec3;
use kernel::picture::{Camera, MOST_SAMPLES, Projection, encode_picture};
use output::render::{
    CameraChoice, Caption, LitFile, LookAt, PictureFormat, TileSettings, ToneMap, choose_view, encode_exr,
    encode_png, read_lit, render_tiles, suitable_exposure,
};
use scene::ReadOptions;

use super::console::print;
use super::options::positive;
use super::outputs::{check_distinct, write_output};
use super::progress::{ProgressLine, short};
use super::report::new_table;
use super::scene_options::BesideOptions;
use super::telemetry::TelemetryArguments;
use super::workers::WorkerArguments;

/// Width of a picture where neither side is given.
const DEFAULT_WIDTH: u32 = 1280;

/// Width over height where no camera says otherwise.
const DEFAULT_ASPECT: f64 = 16.0 / 9.0;

#[derive(Args)]
pub struct RenderArguments {
    /// Lit file to render: .glb or .gltf, as written by `solve`
    file: PathBuf,
    /// Picture to write: .png (8 bits, tone-mapped) or .exr (radiance)
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Width in pixels [default: 1280, or from the height and the camera's aspect]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    width: Option<u32>,
    /// Height in pixels [default: from the width and the camera's aspect, or 16:9]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    height: Option<u32>,
    /// Rays per pixel
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_SAMPLES)))]
    samples: u32,
    /// PNG value per unit of irradiance on white [default: from the file, or one that clips 5 % of the picture]
    #[arg(long, value_parser = positive)]
    exposure: Option<f64>,
    /// How a PNG shows what is brighter than the screen
    #[arg(long, value_enum, default_value_t = ToneMapArgument::Linear)]
    tone_map: ToneMapArgument,
    /// Radiance where there is no surface [default: sky of the bake, or black]
    #[arg(long, value_name = "R,G,B", value_parser = colour)]
    background: Option<DVec3>,
    #[command(flatten)]
    view: ViewArguments,
    /// Scene of the file [default: the file's default scene, or its first]
    #[arg(long, value_name = "INDEX|NAME")]
    scene: Option<String>,
    #[command(flatten)]
    beside: BesideOptions,
    #[command(flatten)]
    pub workers: WorkerArguments,
    #[command(flatten)]
    pub telemetry: TelemetryArguments,
}

/// Where the picture is taken from.
#[derive(Args)]
#[command(next_help_heading = "Camera")]
struct ViewArguments {
    /// Camera of the file [default: the first, or a view of the whole scene]
    ///
    /// Its name, its node's name, or its number among the file's cameras in the order of nodes.
    #[arg(long, value_name = "INDEX|NAME", conflicts_with_all = ["eye", "target"])]
    camera: Option<String>,
    /// Position to look from, in the file's coordinates
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true, requires = "target")]
    eye: Option<DVec3>,
    /// Point to look at
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true, requires = "eye")]
    target: Option<DVec3>,
    /// Up direction of the picture
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true, default_value = "0,1,0", requires = "eye")]
    up: DVec3,
    /// Vertical field of view, in degrees
    #[arg(long, value_name = "DEGREES", value_parser = positive, default_value_t = 45.0, requires = "eye")]
    fov: f64,
}

#[derive(Clone, Copy, ValueEnum)]
enum ToneMapArgument {
    /// Clip at white, as viewers do
    Linear,
    /// Compress all luminances, so that the largest becomes white
    Reinhard,
    /// Khronos PBR Neutral: keep colours up to 0.8, compress highlights
    Neutral,
}

impl ToneMapArgument {
    fn tone_map(self) -> ToneMap {
        match self {
            Self::Linear => ToneMap::Linear,
            Self::Reinhard => ToneMap::Reinhard,
            Self::Neutral => ToneMap::Neutral,
        }
    }
}

impl ViewArguments {
    fn choice(&self) -> CameraChoice {
        match (&self.camera, self.eye, self.target) {
            (Some(camera), _, _) => CameraChoice::OfFile(camera.clone()),
            (None, Some(eye), Some(target)) => {
                let height_angle = self.fov.to_radians();
                CameraChoice::LookAt(LookAt { eye, target, up: self.up, height_angle })
            }
            _ => CameraChoice::Any,
        }
    }
}

/// Makes a picture of one file.
pub fn run(arguments: &RenderArguments, workers: &ClusterSettings) -> anyhow::Result<()> {
    let clock = Instant::now();
    let format = PictureFormat::of(&arguments.output)
        .with_context(|| format!("output {} must end in .png or .exr", arguments.output.display()))?;
    let mut read = vec![("lit file", Some(&*arguments.file))];
    read.extend(arguments.workers.security.files());
    check_distinct(&read, &[("output", Some(&arguments.output))])?;
    files::check(&arguments.output)?;
    let outside_files = arguments.beside.outside_files;
    let options = ReadOptions { scene: arguments.scene.clone(), outside_files, ..ReadOptions::default() };
    let line = ProgressLine::new("import");
    let file = read_lit(&arguments.file, &options)?;
    for warning in &file.warnings {
        line.say(format_args!("warning: {warning}"));
    }
    let (camera, size, words) = camera(&file, arguments)?;
    let background = arguments.background.or(file.sky).unwrap_or(DVec3::ZERO);
    let settings = TileSettings { camera, size, samples: arguments.samples, background };
    let cluster = Cluster::start(workers)?;
    line.enter("render");
    line.restart();
    let tracing = Instant::now();
    let show = |done: usize, total: usize| line.show_part("render", (done as u64, total as u64), "tiles");
    let scene = encode_picture(&file.scene);
    let picture =
        render_tiles(&mut cluster.handle(0), scene, &settings, &mut |done, total| show(done, total))?;
    let tracing = tracing.elapsed().as_secs_f64();
    line.finish();
    let per_worker = cluster.workers();
    cluster.shutdown();
    let exposure = arguments.exposure.or(file.exposure).unwrap_or_else(|| suitable_exposure(&picture));
    let caption = Caption {
        exposure,
        tone_map: arguments.tone_map.tone_map(),
        camera: words,
        samples: arguments.samples,
    };
    let bytes = match format {
        PictureFormat::Png => encode_png(&picture, &caption)?,
        PictureFormat::Exr => encode_exr(&picture, &caption)?,
    };
    write_output(&arguments.output, |out| out.write_all(&bytes))?;

    let triangles: usize = file.scene.parts.iter().map(|part| part.triangles.len()).sum();
    let mut table = new_table();
    let mut row = |name: &str, value: String| {
        table.add_row([name.to_owned(), value]);
    };
    row("time", format!("{:.2} s, {tracing:.2} s of it for the tiles", clock.elapsed().as_secs_f64()));
    row("triangles", triangles.to_string());
    row("picture", format!("{} x {}, {} rays per pixel", size[0], size[1], arguments.samples));
    row("rays", format!("{} ({} rays/s)", picture.rays, short(picture.rays as f64 / tracing)));
    row("camera", caption.camera);
    row("exposure", format!("{exposure:.4e} per unit of irradiance"));
    row("tone map", if format == PictureFormat::Png { caption.tone_map.name() } else { "none" }.to_owned());
    for worker in &per_worker {
        let busy = worker.part.busy.as_secs_f64();
        row(&format!("worker {}", worker.part.name), format!("{} tiles, {busy:.2} s busy", worker.part.jobs));
    }
    print(&table)
}

/// The camera, the size of the picture, and the camera in words.
fn camera(file: &LitFile, arguments: &RenderArguments) -> anyhow::Result<(Camera, [u32; 2], String)> {
    let choice = arguments.view.choice();
    let of_file = choice.of_file(&file.cameras)?;
    let aspect = of_file.and_then(|camera| camera.aspect()).unwrap_or(DEFAULT_ASPECT);
    let side = |length: f64| length.round().clamp(1.0, f64::from(u32::MAX)) as u32;
    let (width, height) = match (arguments.width, arguments.height) {
        (Some(width), Some(height)) => (width, height),
        (Some(width), None) => (width, side(f64::from(width) / aspect)),
        (None, Some(height)) => (side(f64::from(height) * aspect), height),
        (None, None) => (DEFAULT_WIDTH, side(f64::from(DEFAULT_WIDTH) / aspect)),
    };
    let aspect = f64::from(width) / f64::from(height);
    let (camera, words) = match (&choice, of_file) {
        (CameraChoice::LookAt(look_at), _) => {
            let LookAt { eye, target, .. } = look_at;
            let words = format!("from {} to {}", triple(*eye), triple(*target));
            (look_at.camera(&file.frame, aspect)?, words)
        }
        (_, Some(own)) => (own.camera(&file.frame, aspect)?, format!("{} of the file", own.label())),
        (_, None) => {
            let camera = choose_view(&file.scene, aspect);
            (camera, format!("chosen: {}", as_options(&camera, file)))
        }
    };
    Ok((camera, [width, height], words))
}

/// A camera as the options that ask for it.
fn as_options(camera: &Camera, file: &LitFile) -> String {
    let eye = file.frame.to_world(camera.eye);
    let target = file.frame.to_world(camera.eye + camera.forward * 1024.0);
    let Projection::Perspective { half: [_, height] } = camera.projection else { return String::new() };
    format!("--eye {} --target {} --fov {:.1}", triple(eye), triple(target), 2.0 * height.atan().to_degrees())
}

fn triple(point: DVec3) -> String {
    let [x, y, z] = point.to_array().map(|value| format!("{value:.4}"));
    let short = |text: String| text.trim_end_matches('0').trim_end_matches('.').to_owned();
    [x, y, z].map(short).join(",")
}

fn vector(text: &str) -> Result<DVec3, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse::<f64>()).collect();
    match numbers.as_deref() {
        Ok(&[x, y, z]) if [x, y, z].iter().all(|value| value.is_finite()) => Ok(DVec3::new(x, y, z)),
        _ => Err("must be three numbers, separated by commas".into()),
    }
}

fn colour(text: &str) -> Result<DVec3, String> {
    let colour = vector(text)?;
    if (0.0..=1e30).contains(&colour.min_element()) && colour.max_element() <= 1e30 {
        Ok(colour)
    } else {
        Err("must be three numbers that are not negative, separated by commas".into())
    }
}
