use std::fs::File;
use std::io::{self, Cursor};
use std::path::{Path, PathBuf};

use anyhow::Context;
use bake::LightChange;
use clap::{Args, ValueEnum};
use protocol::api::submit_scene_header::Source;
use protocol::api::submit_scene_request::Body;
use protocol::api::{
    self, BakeOptions, CHUNK_BYTES, Format, Job, Relight, SceneFile, SubmitSceneHeader, SubmitSceneRequest,
};
use sha2::{Digest, Sha256};
use tokio::io::AsyncRead;
use tokio_stream::StreamExt;
use tokio_util::bytes::Bytes;
use tokio_util::io::ReaderStream;
use tonic::{Code, Status};
use tonic_types::StatusExt;

use super::super::console::print;
use super::super::options::Given;
use super::super::output_options::OutputOptions;
use super::super::outputs::check_distinct;
use super::super::relight::change;
use super::super::scene_options::SceneOptions;
use super::fetch::{JobFile, fetch};
use super::watch::follow;
use super::{Client, Connection, ServerArgument, refused, wait};

#[derive(Args)]
pub struct SubmitArguments {
    /// Scene to bake: .glb, or .gltf with all data in data URIs
    #[arg(required_unless_present = "relight")]
    scene: Option<PathBuf>,
    /// Relight the scene of this finished job instead of baking one
    ///
    /// The scene is read and baked as it was; --sky is the radiance of the new sky.
    #[arg(long, value_name = "JOB", conflicts_with = "scene")]
    relight: Option<String>,
    /// With --relight: multiply a light by these factors, or all channels by one (repeatable)
    #[arg(long = "light", value_name = "NAME=R,G,B", value_parser = change, requires = "relight")]
    lights: Vec<LightChange>,
    /// Wait until the job is done, and show its progress
    #[arg(long)]
    watch: bool,
    /// Wait until the job is done, and write the lit scene to this file
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    job: Given<SubmitSceneHeader>,
    #[command(flatten)]
    quality: Given<BakeOptions>,
    #[command(flatten)]
    options: SceneOptions,
    /// Format of the lit scene
    #[arg(long, value_enum, default_value_t = FormatName::Glb, help_heading = "Output")]
    format: FormatName,
    #[command(flatten)]
    written: OutputOptions,
    #[command(flatten)]
    server: ServerArgument,
}

#[derive(Clone, Copy, ValueEnum)]
enum FormatName {
    /// Binary glTF
    Glb,
    /// Lit mesh with light as numbers at vertices
    Ply,
}

/// Submits a scene, and waits for its job if that is asked for.
pub fn run(arguments: &SubmitArguments) -> anyhow::Result<()> {
    if let Some(output) = &arguments.output {
        let mut read = vec![
            ("scene", arguments.scene.as_deref()),
            ("sky", arguments.options.sky_path()),
            ("file of probe points", arguments.written.probe_points_path()),
        ];
        read.extend(arguments.server.security.files());
        check_distinct(&read, &[("output", Some(output))])?;
        files::check(output)?;
    }
    let scene = match &arguments.scene {
        Some(scene) => Some(match arguments.options.put_sky(scene)? {
            Some(bytes) => SceneBytes::Made(bytes.into()),
            None => SceneBytes::Of(scene.clone()),
        }),
        None => {
            arguments.options.sky("give the new radiance")?;
            None
        }
    };
    let header = header(arguments, scene.as_ref())?;
    wait(async {
        let mut connection = Connection::open(&arguments.server).await?;
        let job = submit(&mut connection.client, header, scene.as_ref()).await?;
        // The job goes on, and so does what was asked for.
        let named = || format!("job {}", job.id);
        let printed = print(&job.id).with_context(named);
        if arguments.watch || arguments.output.is_some() {
            follow(&mut connection, &job.id).await.with_context(named)?;
        }
        if let Some(output) = &arguments.output {
            fetch(&mut connection, JobFile::Result, &job.id, output).await.with_context(named)?;
        }
        printed
    })
}

/// The scene that is sent.
enum SceneBytes {
    /// This file.
    Of(PathBuf),
    /// What was made of one.
    Made(Bytes),
}

impl SceneBytes {
    async fn read(&self) -> anyhow::Result<Box<dyn AsyncRead + Send + Unpin>> {
        Ok(match self {
            Self::Of(path) => Box::new(tokio::fs::File::open(path).await.with_context(|| unreadable(path))?),
            Self::Made(bytes) => Box::new(Cursor::new(bytes.clone())),
        })
    }

    fn name(&self) -> anyhow::Result<SceneFile> {
        let mut hasher = Sha256::new();
        let size = match self {
            Self::Of(path) => File::open(path)
                .and_then(|mut file| io::copy(&mut file, &mut hasher))
                .with_context(|| unreadable(path))?,
            Self::Made(bytes) => {
                hasher.update(bytes);
                bytes.len() as u64
            }
        };
        Ok(SceneFile { sha256: hasher.finalize().to_vec().into(), size })
    }
}

fn unreadable(path: &Path) -> String {
    format!("{} cannot be read", path.display())
}

fn header(arguments: &SubmitArguments, scene: Option<&SceneBytes>) -> anyhow::Result<SubmitSceneHeader> {
    let source = match (scene, &arguments.relight) {
        (Some(scene), _) => Source::File(scene.name()?),
        (None, job) => Source::Relight(relight(arguments, job.clone().unwrap_or_default())),
    };
    let stem = || {
        let stem = arguments.scene.as_ref().and_then(|scene| scene.file_stem());
        stem.unwrap_or_default().to_string_lossy().into_owned()
    };
    let format = match arguments.format {
        FormatName::Glb => Format::Glb,
        FormatName::Ply => Format::Ply,
    };
    let given = arguments.job.0.clone();
    Ok(SubmitSceneHeader {
        name: if given.name.is_empty() { stem() } else { given.name },
        source: Some(source),
        scene: Some(arguments.options.options()),
        bake: Some(arguments.quality.0),
        output: Some(arguments.written.options(format)),
        ..given
    })
}

fn relight(arguments: &SubmitArguments, job_id: String) -> Relight {
    let change = |change: &LightChange| api::LightChange {
        light: change.light.clone(),
        factor: Some(api::Colour { r: change.factor.x, g: change.factor.y, b: change.factor.z }),
    };
    let lights = arguments.lights.iter().map(change).collect();
    Relight { job_id, lights, sky: arguments.options.options().sky }
}

/// Sends the header alone first: a scene that the service has is not sent again.
async fn submit(
    client: &mut Client,
    header: SubmitSceneHeader,
    scene: Option<&SceneBytes>,
) -> anyhow::Result<Job> {
    let first = SubmitSceneRequest { body: Some(Body::Header(header)) };
    let scene = match (client.submit_scene(tokio_stream::once(first.clone())).await, scene) {
        (Ok(job), _) => return Ok(job.into_inner()),
        (Err(status), Some(scene)) if wants_scene(&status) => scene,
        (Err(status), _) => return Err(refused(status)),
    };
    // A file that cannot be read to its end is too short, and refused for it.
    let chunks = ReaderStream::with_capacity(scene.read().await?, CHUNK_BYTES).map_while(Result::ok);
    let chunks = chunks.map(|bytes| SubmitSceneRequest { body: Some(Body::Chunk(bytes)) });
    let job = client.submit_scene(tokio_stream::once(first).chain(chunks)).await;
    Ok(job.map_err(refused)?.into_inner())
}

/// Whether a service asks for the bytes of the scene.
fn wants_scene(status: &Status) -> bool {
    let missing = status.get_details_precondition_failure();
    status.code() == Code::FailedPrecondition
        && missing.is_some_and(|missing| missing.violations.iter().any(|wrong| wrong.r#type == "SCENE"))
}
