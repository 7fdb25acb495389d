//! A service under load: 50 clients that submit, watch, ask and fetch for a minute while it bakes, then a long queue. Prints how long
//! calls took, how busy the cores were that bake, and what memory the service had. Fails when any call does.
//!
//!     cargo build --release -p coordinator && cargo measure storm [-- SECONDS]

use std::error::Error;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use protocol::api::fetch_result_response::Body as Part;
use protocol::api::radiosity_client::RadiosityClient;
use protocol::api::submit_scene_header::Source;
use protocol::api::submit_scene_request::Body;
use protocol::api::{
    BakeOptions, DeleteJobRequest, FetchResultRequest, GetJobRequest, Job, ListJobsRequest, SceneFile, State,
    SubmitSceneHeader, SubmitSceneRequest, WatchJobRequest,
};
use sha2::{Digest, Sha256};
use tests::service::ServiceProcess;
use tokio::time::{sleep, timeout_at};
use tonic::Status;
use tonic::transport::Channel;

/// Clients at the same time.
const CLIENTS: usize = 50;

/// Jobs of the long queue.
const QUEUED: usize = 1000;

/// From one submission of a client to its next.
const PAUSE: Duration = Duration::from_secs(2);

/// From the end of all jobs to the last look at the memory.
const REST: Duration = Duration::from_secs(10);

type Client = RadiosityClient<Channel>;

type Fallible<T> = Result<T, Box<dyn Error + Send + Sync>>;

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
        for name in ["submit", "get", "list", "delete"] {
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

/// A line of what the system says of a process, in MiB: `VmRSS`, its memory, or `VmHWM`, the most that it had.
fn memory(process: u32, line: &str) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let mut words = status.lines().filter_map(|text| text.split_once(':'));
    let kibibytes =
        words.find(|(name, _)| *name == line).and_then(|(_, value)| value.split_whitespace().next());
    kibibytes.and_then(|number| number.parse::<f64>().ok()).unwrap_or_default() / 1024.0
}

/// For how long the threads that compute rows have had a core, in seconds.
fn computed(process: u32) -> Fallible<f64> {
    let mut nanoseconds = 0.0;
    for thread in std::fs::read_dir(format!("/proc/{process}/task"))? {
        let path = thread?.path();
        // Other threads come and go.
        let Ok(name) = std::fs::read_to_string(path.join("comm")) else { continue };
        if name.starts_with("compute-") {
            let times = std::fs::read_to_string(path.join("schedstat"))?;
            nanoseconds += times.split(' ').next().unwrap_or_default().parse::<f64>()?;
        }
    }
    Ok(nanoseconds * 1e-9)
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

/// Watches a job until the storm ends; fetches its lit file when it is done before. Whether it was.
async fn follow(mut client: Client, id: String, end: Instant) -> Result<bool, Status> {
    let mut jobs = client.watch_job(WatchJobRequest { id: id.clone() }).await?.into_inner();
    let mut last = None::<Job>;
    while let Ok(job) = timeout_at(end.into(), jobs.message()).await {
        let Some(job) = job? else { break };
        last = Some(job);
    }
    let Some(outcome) = last.filter(|job| job.state() == State::Done).and_then(|job| job.outcome) else {
        return Ok(false);
    };
    let fetch = FetchResultRequest { id, ..FetchResultRequest::default() };
    let mut parts = client.fetch_result(fetch).await?.into_inner();
    let mut bytes = 0;
    while let Some(part) = parts.message().await? {
        if let Some(Part::Chunk(chunk)) = part.body {
            bytes += chunk.len() as u64;
        }
    }
    if bytes == outcome.size { Ok(true) } else { Err(Status::data_loss("the lit file is not whole")) }
}

/// One client: submits, watches what it submitted, and asks now and then. How many jobs it submitted, and how many were done.
async fn storm(address: String, scene: Arc<Vec<u8>>, end: Instant, times: Times) -> Fallible<(usize, usize)> {
    let mut client = RadiosityClient::connect(address).await?;
    let mut followers = vec![];
    while Instant::now() < end {
        let id = times.of("submit", submit(&mut client, header(&scene, 0.03), &scene)).await?;
        followers.push(tokio::spawn(follow(client.clone(), id.clone(), end)));
        for _ in 0..4 {
            times.of("get", client.get_job(GetJobRequest { id: id.clone() })).await?;
            let list = ListJobsRequest { page_size: 20, ..ListJobsRequest::default() };
            times.of("list", client.list_jobs(list)).await?;
            sleep(PAUSE / 4).await;
        }
    }
    let (submitted, mut done) = (followers.len(), 0);
    for follower in followers {
        done += usize::from(follower.await??);
    }
    Ok((submitted, done))
}

/// Deletes all jobs.
async fn clear(client: &mut Client, times: &Times) -> Result<(), Status> {
    loop {
        let list = ListJobsRequest { page_size: 1000, ..ListJobsRequest::default() };
        let jobs = client.list_jobs(list).await?.into_inner().jobs;
        if jobs.is_empty() {
            return Ok(());
        }
        for job in jobs {
            times.of("delete", client.delete_job(DeleteJobRequest { id: job.id })).await?;
        }
    }
}

/// Submits the long queue and lists it: the longest of 20 times.
async fn list_queue(client: &mut Client, scene: &[u8]) -> Fallible<Duration> {
    for _ in 0..QUEUED {
        submit(client, header(scene, 0.0005), scene).await?;
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
    Ok(longest)
}

async fn run(seconds: u64) -> Fallible<()> {
    let folder = tempfile::tempdir()?;
    let service = ServiceProcess::start(folder.path(), &["--queue-per-client", "100000"]);
    let scene = Arc::new(std::fs::read(tests::data("scenes/cornell.glb"))?);
    let address = format!("http://{}", service.address);
    let mut client = RadiosityClient::connect(address.clone()).await?;
    let times = Times::default();

    // What one bake leaves behind is no growth.
    let first = submit(&mut client, header(&scene, 0.03), &scene).await?;
    let mut jobs = client.watch_job(WatchJobRequest { id: first }).await?.into_inner();
    while jobs.message().await?.is_some() {}
    println!("memory: {:.0} MiB before", memory(service.id(), "VmRSS"));

    let (clock, computed_before) = (Instant::now(), computed(service.id())?);
    let end = clock + Duration::from_secs(seconds);
    let clients: Vec<_> = (0..CLIENTS)
        .map(|_| tokio::spawn(storm(address.clone(), Arc::clone(&scene), end, times.clone())))
        .collect();
    let (mut submitted, mut done) = (0, 0);
    for client in clients {
        let (of, of_these) = client.await??;
        submitted += of;
        done += of_these;
    }
    let cores = (computed(service.id())? - computed_before) / clock.elapsed().as_secs_f64();
    println!(
        "{CLIENTS} clients, {seconds} s: {submitted} jobs submitted, {done} of them done, watched and fetched"
    );
    println!("{cores:.2} cores computed rows meanwhile");
    println!("memory: {:.0} MiB at the most", memory(service.id(), "VmHWM"));
    clear(&mut client, &times).await?;
    times.print();
    sleep(REST).await;
    println!("memory: {:.0} MiB when all jobs are deleted", memory(service.id(), "VmRSS"));

    let longest = list_queue(&mut client, &scene).await?;
    println!("{QUEUED} unfinished jobs listed: {:.1} ms, the longest of 20", longest.as_secs_f64() * 1e3);
    clear(&mut client, &times).await?;
    sleep(REST).await;
    println!(
        "memory: {:.0} MiB at the most, {:.0} MiB when all jobs are deleted",
        memory(service.id(), "VmHWM"),
        memory(service.id(), "VmRSS")
    );
    Ok(())
}

fn main() -> Fallible<()> {
    let seconds = std::env::args().nth(1).map_or(Ok(60), |seconds| seconds.parse())?;
    tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?.block_on(run(seconds))
}
