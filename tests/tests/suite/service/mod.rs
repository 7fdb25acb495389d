//! The long-running service, by real processes, against `coordinator solve` and against what its protocol promises.
//!
//! | module | what is held against what |
//! |---|---|
//! | `bytes` | lit files of jobs against those of `solve`, also where the service is killed in between |
//! | `asking` | keys, scenes sent once, pages, cancelled and deleted jobs |
//! | `refusals` | wrong submissions against the codes and details that the protocol promises |
//! | `clients` | clients against each other, tokens, plain text |
//! | `encryption` | certificates of clients against the authority of the service |
//! | `renewal` | certificates that change while the service runs, against new and live connections |
//! | `slow` | clients that do not take what they asked for, against those who do |
//! | `disk` | a disk that is full |
//! | `damage` | a disk that changes or loses files |
//! | `relight` | jobs that are done lit otherwise, against `coordinator relight` |
//! | `keeping` | what is kept no longer, against what must be |
//! | `processes` | processes of jobs that are killed, or need too much, against all others |
//! | `counts` | the metrics page against what was done |
//! | `restarts` | commands that wait, against services and connections that break in between |
//! | `figures` | dashboard and alerts against the page of metrics |
//! | `reflection` | a client that knows nothing but what the service says of itself |

mod asking;
mod bytes;
mod clients;
mod counts;
mod damage;
mod disk;
mod encryption;
mod figures;
mod keeping;
mod processes;
mod reflection;
mod refusals;
mod relight;
mod renewal;
mod restarts;
mod slow;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use protocol::api::radiosity_client::RadiosityClient;
use protocol::api::submit_scene_header::Source;
use protocol::api::submit_scene_request::Body;
use protocol::api::{BakeOptions, SceneFile, SubmitSceneHeader, SubmitSceneRequest};
use sha2::{Digest, Sha256};
use tempfile::TempDir;
use tests::service::ServiceProcess;
use tokio::runtime::Runtime;
use tonic::transport::Channel;
use tonic::{Request, Status};

/// Far above what any of this takes: only what hangs ends here.
const HANGS: Duration = Duration::from_secs(120);

/// A bake of some tenths of a second.
const QUICK: [&str; 2] = ["--error", "0.05"];

/// That of headers.
const MESH_ERROR: f64 = 0.05;

/// A bake that does not end while it is looked at.
const ENDLESS: [&str; 4] = ["--mesh-error", "0.0001", "--max-vertices", "2000000"];

fn cornell() -> PathBuf {
    tests::data("scenes/cornell.glb")
}

/// A service on a folder of its own.
struct Room {
    folder: TempDir,
}

impl Room {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    fn file(&self, name: &str, content: &[u8]) -> PathBuf {
        let path = self.folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        path
    }

    fn start(&self, arguments: &[&str]) -> ServiceProcess {
        ServiceProcess::start(&self.data(), arguments)
    }

    /// Names of the files in a folder of the data folder.
    fn names(&self, folder: &str) -> Vec<String> {
        let files = std::fs::read_dir(self.data().join(folder)).unwrap();
        files.map(|file| file.unwrap().file_name().into_string().unwrap()).collect()
    }
}

/// Waits until something is true.
fn wait_for(what: &str, mut is_so: impl FnMut() -> bool) {
    let clock = Instant::now();
    while !is_so() {
        assert!(clock.elapsed() < HANGS, "it is not so that {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// A client of the API itself.
struct Asker {
    runtime: Runtime,
    client: RadiosityClient<Channel>,
    token: Option<String>,
}

impl Asker {
    fn new(service: &ServiceProcess, token: Option<&str>) -> Self {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let address = format!("http://{}", service.address);
        let client = runtime.block_on(RadiosityClient::connect(address)).unwrap();
        Self { runtime, client, token: token.map(|token| format!("Bearer {token}")) }
    }

    /// Asks once, with the token.
    fn ask<M, F, T>(&mut self, message: M, call: F) -> Result<T, Status>
    where
        F: AsyncFnOnce(&mut RadiosityClient<Channel>, Request<M>) -> Result<tonic::Response<T>, Status>,
    {
        let mut request = Request::new(message);
        if let Some(token) = &self.token {
            request.metadata_mut().insert("authorization", token.parse().unwrap());
        }
        let Self { runtime, client, .. } = self;
        runtime.block_on(call(client, request)).map(tonic::Response::into_inner)
    }

    /// Submits this header and these chunks.
    fn submit(&mut self, header: SubmitSceneHeader, chunks: &[&[u8]]) -> Result<protocol::api::Job, Status> {
        let chunks = chunks.iter().map(|chunk| Body::Chunk(chunk.to_vec().into()));
        let bodies: Vec<Body> = [Body::Header(header)].into_iter().chain(chunks).collect();
        self.submit_bodies(bodies)
    }

    fn submit_bodies(&mut self, bodies: Vec<Body>) -> Result<protocol::api::Job, Status> {
        let messages = bodies.into_iter().map(|body| SubmitSceneRequest { body: Some(body) });
        let messages = tokio_stream::iter(messages.collect::<Vec<_>>());
        self.ask(messages, async |client, request| client.submit_scene(request).await)
    }
}

/// What a file is submitted with.
fn header(file: &[u8]) -> SubmitSceneHeader {
    let scene = SceneFile { sha256: Sha256::digest(file).to_vec().into(), size: file.len() as u64 };
    SubmitSceneHeader {
        name: "room".into(),
        source: Some(Source::File(scene)),
        bake: Some(BakeOptions { mesh_error: Some(MESH_ERROR), ..BakeOptions::default() }),
        ..SubmitSceneHeader::default()
    }
}

/// A path as an argument.
fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}
