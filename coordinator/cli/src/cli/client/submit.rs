use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::Context;
use bake::LightChange;
use clap::{Args, ValueEnum};
use output::files;
use protocol::api::submit_scene_header::Source;
use protocol::api::submit_scene_request::Body;
use protocol::api::{
    self, CHUNK_BYTES, Format, Job, Relight, SceneFile, SubmitSceneHeader, SubmitSceneRequest,
};
use protocol::security::ClientSecurity;
use sha2::{Digest, Sha256};
use tokio_stream::StreamExt;
use tokio_util::io::ReaderStream;
use tonic::{Code, Status};
use tonic_types::StatusExt;

use super::super::knobs::Knobs;
use super::super::output_options::OutputOptions;
use super::super::relight::change;
use super::super::scene_options::SceneOptions;
use super::fetch::{FileRequest, fetch};
use super::watch::follow;
use super::{Client, Connection, ServerArgument, refused, wait};

#[derive(Args)]
pub struct SubmitArguments {
    /// Scene to bake: .glb, or .gltf with all that it needs in data URIs.
    #[arg(required_unless_present = "relight")]
    scene: Option<PathBuf>,
    /// In place of a scene: light the one of this job, which is done, otherwise. How the scene is read and baked stays as it was; --sky is
    /// the radiance of the new sky.
    #[arg(long, value_name = "JOB", conflicts_with = "scene")]
    relight: Option<String>,
    /// With --relight: multiply a light by this, channel by channel, or all channels by one number. May be given several times.
    #[arg(long = "light", value_name = "NAME=R,G,B", value_parser = change, requires = "relight")]
    lights: Vec<LightChange>,
    /// What the job is called [default: the file's name].
    #[arg(long)]
    name: Option<String>,
    /// Jobs of higher priority begin first.
    #[arg(long, default_value_t = 0, allow_hyphen_values = true, value_parser = clap::value_parser!(i32).range(-100..=100))]
    priority: i32,
    /// A word of your own for this submission: the same again gives the same job, whether or not the first answer arrived.
    #[arg(long, value_name = "WORD")]
    key: Option<String>,
    /// What comes out.
    #[arg(long, value_enum, default_value_t = FormatName::Glb)]
    format: FormatName,
    /// Wait until the job is done, and show how far it is.
    #[arg(long)]
    watch: bool,
    /// Wait until the job is done, and write the lit scene here.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    server: ServerArgument,
    #[command(flatten)]
    options: SceneOptions,
    #[command(flatten)]
    written: OutputOptions,
    #[command(flatten)]
    knobs: Knobs,
}

#[derive(Clone, Copy, ValueEnum)]
enum FormatName {
    /// Binary glTF.
    Glb,
    /// The lit mesh with light as numbers at its vertices.
    Ply,
}

/// Submits a scene, and waits for it where that is asked for.
pub fn run(arguments: &SubmitArguments, security: &ClientSecurity) -> anyhow::Result<()> {
    if let Some(output) = &arguments.output {
        files::check(output)?;
    }
    let header = header(arguments)?;
    wait(async {
        let mut connection = Connection::open(&arguments.server, security).await?;
        let job = submit(&mut connection.client, header, arguments.scene.as_deref()).await?;
        println!("{}", job.id);
        if arguments.watch || arguments.output.is_some() {
            follow(&mut connection, &job.id).await?;
        }
        match &arguments.output {
            Some(output) => fetch(&mut connection, FileRequest::Result, &job.id, output).await,
            None => Ok(()),
        }
    })
}

fn header(arguments: &SubmitArguments) -> anyhow::Result<SubmitSceneHeader> {
    let source = match (&arguments.scene, &arguments.relight) {
        (Some(scene), _) => Source::File(scene_file(scene)?),
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
    Ok(SubmitSceneHeader {
        name: arguments.name.clone().unwrap_or_else(stem),
        source: Some(source),
        scene: Some(arguments.options.options()),
        bake: Some(arguments.knobs.options()),
        output: Some(arguments.written.options(format)),
        priority: arguments.priority,
        idempotency_key: arguments.key.clone().unwrap_or_default(),
    })
}

fn scene_file(path: &Path) -> anyhow::Result<SceneFile> {
    let digest = || -> io::Result<SceneFile> {
        let mut hasher = Sha256::new();
        let size = io::copy(&mut File::open(path)?, &mut hasher)?;
        Ok(SceneFile { sha256: hasher.finalize().to_vec().into(), size })
    };
    digest().with_context(|| format!("{} cannot be read", path.display()))
}

fn relight(arguments: &SubmitArguments, job_id: String) -> Relight {
    let change = |change: &LightChange| api::LightChange {
        light: change.light.clone(),
        factor: Some(api::Colour { r: change.factor.x, g: change.factor.y, b: change.factor.z }),
    };
    let lights = arguments.lights.iter().map(change).collect();
    Relight { job_id, lights, sky: arguments.options.options().sky }
}

/// The header alone first: a scene that the service has is not sent again.
async fn submit(client: &mut Client, header: SubmitSceneHeader, scene: Option<&Path>) -> anyhow::Result<Job> {
    let first = SubmitSceneRequest { body: Some(Body::Header(header)) };
    let scene = match (client.submit_scene(tokio_stream::once(first.clone())).await, scene) {
        (Ok(job), _) => return Ok(job.into_inner()),
        (Err(status), Some(scene)) if wants_scene(&status) => scene,
        (Err(status), _) => return Err(refused(status)),
    };
    let file =
        tokio::fs::File::open(scene).await.with_context(|| format!("{} cannot be read", scene.display()))?;
    // A file that cannot be read to its end is too short, and refused for it.
    let chunks = ReaderStream::with_capacity(file, CHUNK_BYTES).map_while(Result::ok);
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
