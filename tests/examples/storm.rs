//! A service under load: 50 clients that submit, watch and ask for a minute while it bakes, then a long queue. Prints how long calls
//! took and what memory the service had.
//!
//!     cargo build --release -p coordinator && cargo run --release -p tests --example storm [-- SECONDS]

use std::error::Error;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use sha2::{Digest, Sha256};
use shared::api::radiosity_client::RadiosityClient;
use shared::api::submit_scene_header::Source;
use shared::api::submit_scene_request::Body;
use shared::api::{
    BakeOptions, DeleteJobRequest, GetJobRequest, ListJobsRequest, SceneFile, State, SubmitSceneHeader,
    SubmitSceneRequest, WatchJobRequest,
};
use tests::service::ServiceProcess;
use tokio::time::sleep;
use tonic::Status;
use tonic::transport::Channel;

/// Clients at the same time.
const CLIENTS: usize = 50;

/// Jobs of the long queue.
const QUEUED: usize = 1000;

/// From one submission of a client to its next.
const PAUSE: Duration = Duration::from_secs(2);

type Client = RadiosityClient<Channel>;

/// How long calls took, by name.
#[derive(Clone, Default)]
struct Times(Arc<Mutex<Vec<(&'static str, Duration)>>>);

impl Times {
    async fn of<T>(&self, name: &'static str, call: impl Future<Output = T>) -> T {
        let clock = Instant::now();
        let answer = call.await;
        self.0.lock().expect("nobody panics").push((name, clock.elapsed()));
        answer
    }

    fn print(&self) {
        let times = self.0.lock().expect("nobody panics");
        for name in ["submit", "get", "list"] {
            let mut of: Vec<Duration> =
                times.iter().filter(|(call, _)| *call == name).map(|(_, time)| *time).collect();
            of.sort_unstable();
            if let Some(last) = of.last() {
                let at = |part: f64| of[((of.len() - 1) as f64 * part) as usize].as_secs_f64() * 1e3;
                println!(
                    "{name:7} {:6} calls: median {:.2} ms, p99 {:.2} ms, longest {:.2} ms",
                    of.len(),
                    at(0.5),
                    at(0.99),
                    last.as_secs_f64() * 1e3
                );
            }
        }
    }
}

/// Resident memory of a process, in MiB.
fn memory(process: u32) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap_or("0 kB");
    line.trim().trim_end_matches("kB").trim().parse::<f64>().unwrap_or_default() / 1024.0
}

fn header(scene: &[u8], mesh_error: f64) -> SubmitSceneHeader {
    let file = SceneFile { sha256: Sha256::digest(scene).to_vec().into(), size: scene.len() as u64 };
    SubmitSceneHeader {
        name: "storm".into(),
        source: Some(Source::File(file)),
        bake: Some(BakeOptions { mesh_error: Some(mesh_error), ..BakeOptions::default() }),
        ..SubmitSceneHeader::default()
    }
}

async fn submit(client: &mut Client, header: SubmitSceneHeader, scene: &[u8]) -> Result<String, Status> {
    let header = SubmitSceneRequest { body: Some(Body::Header(header)) };
    let chunk = SubmitSceneRequest { body: Some(Body::Chunk(scene.to_vec().into())) };
    let job = client.submit_scene(tokio_stream::iter([header, chunk])).await?;
    Ok(job.into_inner().id)
}

/// One client: submits, watches what it submitted, and asks now and then.
async fn storm(
    address: String,
    scene: Arc<Vec<u8>>,
    end: Instant,
    times: Times,
) -> Result<usize, Box<dyn Error + Send + Sync>> {
    let mut client = RadiosityClient::connect(address).await?;
    let mut watching = vec![];
    while Instant::now() < end {
        let id = times.of("submit", submit(&mut client, header(&scene, 0.03), &scene)).await?;
        let mut watcher = client.clone();
        let request = WatchJobRequest { id: id.clone() };
        watching.push(tokio::spawn(async move {
            let mut jobs = watcher.watch_job(request).await?.into_inner();
            while Instant::now() < end && jobs.message().await?.is_some() {}
            Ok::<_, Status>(())
        }));
        for _ in 0..4 {
            times.of("get", client.get_job(GetJobRequest { id: id.clone() })).await?;
            let list = ListJobsRequest { page_size: 20, ..ListJobsRequest::default() };
            times.of("list", client.list_jobs(list)).await?;
            sleep(PAUSE / 4).await;
        }
    }
    let count = watching.len();
    for watcher in watching {
        watcher.abort();
    }
    Ok(count)
}

/// Deletes all jobs.
async fn clear(client: &mut Client) -> Result<(), Status> {
    loop {
        let list = ListJobsRequest { page_size: 1000, ..ListJobsRequest::default() };
        let jobs = client.list_jobs(list).await?.into_inner().jobs;
        if jobs.is_empty() {
            return Ok(());
        }
        for job in jobs {
            client.delete_job(DeleteJobRequest { id: job.id }).await?;
        }
    }
}

async fn run(seconds: u64) -> Result<(), Box<dyn Error + Send + Sync>> {
    let folder = tempfile::tempdir()?;
    let service = ServiceProcess::start(folder.path(), &["--queue-per-client", "100000"]);
    let scene = Arc::new(std::fs::read(tests::data("scenes/cornell.glb"))?);
    let address = format!("http://{}", service.address);
    let mut client = RadiosityClient::connect(address.clone()).await?;

    // What one bake leaves behind is no growth.
    let first = submit(&mut client, header(&scene, 0.03), &scene).await?;
    let mut jobs = client.watch_job(WatchJobRequest { id: first }).await?.into_inner();
    while jobs.message().await?.is_some() {}
    let before = memory(service.id());

    let (times, end) = (Times::default(), Instant::now() + Duration::from_secs(seconds));
    let clients: Vec<_> = (0..CLIENTS)
        .map(|_| tokio::spawn(storm(address.clone(), Arc::clone(&scene), end, times.clone())))
        .collect();
    let mut submitted = 0;
    for client in clients {
        submitted += client.await??;
    }
    println!("{CLIENTS} clients, {seconds} s, {submitted} jobs submitted");
    times.print();
    let during = memory(service.id());
    clear(&mut client).await?;

    for _ in 0..QUEUED {
        submit(&mut client, header(&scene, 0.0005), &scene).await?;
    }
    let mut longest = Duration::ZERO;
    for _ in 0..20 {
        let list = ListJobsRequest {
            page_size: 1000,
            states: vec![State::Queued.into(), State::Running.into()],
            ..ListJobsRequest::default()
        };
        let clock = Instant::now();
        let jobs = client.list_jobs(list).await?.into_inner().jobs;
        longest = longest.max(clock.elapsed());
        assert_eq!(jobs.len(), QUEUED);
    }
    println!("{QUEUED} unfinished jobs listed: {:.1} ms, the longest of 20", longest.as_secs_f64() * 1e3);
    clear(&mut client).await?;
    sleep(Duration::from_secs(5)).await;
    println!(
        "memory: {before:.0} MiB before, {during:.0} MiB at the end of the storm, {:.0} MiB after all jobs were deleted",
        memory(service.id())
    );
    Ok(())
}

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let seconds = std::env::args().nth(1).map_or(Ok(60), |seconds| seconds.parse())?;
    tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?.block_on(run(seconds))
}
