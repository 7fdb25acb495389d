use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use bytes::Bytes;
use protocol::api::submit_scene_header::Source;
use protocol::api::{Job, ListJobsRequest, SceneFile, State, SubmitSceneHeader};
use sha2::{Digest, Sha256};
use tempfile::TempDir;
use tokio_stream::StreamExt;

use crate::job::{SceneDigest, Sequence};
use crate::queue::Places;
use crate::*;
use cluster::{ClusterSettings, Workers};

const DAY: Duration = Duration::from_secs(24 * 3600);

/// A service with one slot and a worker that never connects: a job that starts does not end.
fn service(folder: &TempDir, limits: Limits) -> Service {
    let nobody = Workers::Remote(vec!["127.0.0.1:1".into()]);
    let workers = ClusterSettings { grace: ClusterSettings::ENDLESS_GRACE, ..nobody.into() };
    let workers = Cluster::start_in_background(&workers).unwrap();
    let places = Places { all: 1, of_a_client: 1 };
    // A process that reads its job and does nothing.
    let job_command = ["sh", "-c", "cat > /dev/null"].map(Into::into).to_vec();
    let settings = ServiceSettings { job_command, data: folder.path().join("data"), places, limits };
    Service::open(&settings, workers, Metrics::default()).unwrap()
}

fn everybody() -> ClientName {
    ClientName::everybody()
}

/// Submits a job with cornell.
async fn submit(service: &Service) -> Job {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/scenes/cornell.glb"));
    let scene = Bytes::from(std::fs::read(path).unwrap());
    let file = SceneFile { sha256: Sha256::digest(&scene).to_vec().into(), size: scene.len() as u64 };
    let header = SubmitSceneHeader { source: Some(Source::File(file)), ..SubmitSceneHeader::default() };
    service.submit(&everybody(), header, tokio_stream::once(Ok(scene))).await.unwrap()
}

fn record(id: u128) -> Record {
    Record {
        id: JobId(id),
        client: everybody(),
        sequence: Sequence(id as u64),
        header: SubmitSceneHeader::default(),
        scene: SceneDigest([7; 32]),
        relit: None,
        state: State::Queued,
        failure: String::new(),
        submitted: SystemTime::now(),
        started: None,
        ended: None,
        outcome: None,
        revision: 0,
        crashes: 0,
    }
}

/// Stores a job that ended `age` ago, with its lit file.
fn put_ended(folder: &TempDir, id: u128, age: Duration) {
    let Opened { store, .. } = Store::open(&folder.path().join("data")).unwrap();
    let ended = record(id).ended(State::Done, String::new(), None);
    let ended = Record { ended: Some(SystemTime::now() - age), ..ended };
    std::fs::write(store.scene(ended.scene), [0; 100]).unwrap();
    std::fs::write(store.result(&ended), vec![0; 1 << 20]).unwrap();
    store.write(&ended).unwrap();
}

/// Jobs, newest first.
fn listed(service: &Service) -> Vec<Job> {
    service.list(&everybody(), &ListJobsRequest::default()).unwrap().jobs
}

fn count(folder: &TempDir, of: &str) -> usize {
    std::fs::read_dir(folder.path().join("data").join(of)).unwrap().count()
}

#[tokio::test(start_paused = true)]
async fn a_slow_watcher_skips_states() {
    let folder = tempfile::tempdir().unwrap();
    let service = service(&folder, Limits::default());
    let Job { id, .. } = submit(&service).await;
    let watch = || service.watch(&everybody(), &id).unwrap();
    let (mut slow, mut quick) = (watch(), watch());
    let mut told = quick.next().await.unwrap().unwrap();
    for _ in 0..100 {
        lock(&service.inner.ledger).change(id.parse().unwrap(), |_| {});
        let next = quick.next().await.unwrap().unwrap();
        assert!(next.revision > told.revision, "the slow one holds up the other");
        told = next;
    }
    // What it was told at first waits for it, and then comes what is so now.
    let first = slow.next().await.unwrap().unwrap();
    assert!(first.revision < told.revision);
    assert_eq!(slow.next().await.unwrap().unwrap().revision, told.revision);
}

/// Uploads that stand still, or hardly move, give way to others.
#[tokio::test(start_paused = true)]
async fn slow_uploads_block_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let service = service(&folder, Limits { uploads_of_a_client: 2, ..Limits::default() });
    let file = SceneFile { sha256: vec![7; 32].into(), size: 1 << 30 };
    let header = SubmitSceneHeader { source: Some(Source::File(file)), ..SubmitSceneHeader::default() };
    let start = |bytes: usize| {
        let (service, header) = (service.clone(), header.clone());
        let chunks = tokio_stream::once(Ok(Bytes::from(vec![0; bytes]))).chain(tokio_stream::pending());
        tokio::spawn(async move { service.submit(&everybody(), header, chunks).await })
    };
    let (quick, slow) = (start(1 << 20), start(1));
    tokio::time::sleep(Duration::from_secs(1)).await;
    let early = start(1).await.unwrap();
    assert!(matches!(early, Err(Refusal::Exhausted { .. })), "{early:?}");
    tokio::time::sleep(Duration::from_secs(2)).await;
    let job = submit(&service).await;
    assert_eq!(job.state(), State::Queued);
    assert!(matches!(slow.await.unwrap(), Err(Refusal::Broken(_))));
    assert!(!quick.is_finished(), "the quicker one goes on");
    quick.abort();
}

#[tokio::test(start_paused = true)]
async fn expired_jobs_are_deleted_while_the_service_runs() {
    let folder = tempfile::tempdir().unwrap();
    put_ended(&folder, 1, 40 * DAY);
    put_ended(&folder, 2, 20 * DAY);
    put_ended(&folder, 3, DAY);
    let service = service(&folder, Limits { keep_bytes: 3 << 19, ..Limits::default() });
    assert_eq!(listed(&service).len(), 3);
    service.resume();
    let (running, queued, cancelled) =
        (submit(&service).await, submit(&service).await, submit(&service).await);
    tokio::time::sleep(TIDY / 2).await;
    // The first goes by its age, the second because there is room for one lit file and a half.
    assert_eq!((count(&folder, "jobs"), count(&folder, "results")), (4, 1));
    service.cancel(&everybody(), &cancelled.id).await.unwrap();
    lock(&service.inner.ledger).change(JobId(3), |entry| {
        entry.record.ended = Some(SystemTime::now() - 31 * DAY);
    });
    tokio::time::sleep(TIDY).await;
    let states =
        |jobs: Vec<Job>| jobs.into_iter().map(|job| (job.id.clone(), job.state())).collect::<Vec<_>>();
    let expected =
        [(cancelled.id, State::Cancelled), (queued.id, State::Queued), (running.id, State::Running)];
    assert_eq!(states(listed(&service)), expected);
    assert_eq!((count(&folder, "results"), count(&folder, "scenes")), (0, 1));
}

/// However little may be kept, jobs that have not ended stay, and their scenes.
#[tokio::test(start_paused = true)]
async fn unfinished_jobs_never_expire() {
    let folder = tempfile::tempdir().unwrap();
    put_ended(&folder, 1, Duration::ZERO);
    let service = service(&folder, Limits { keep_bytes: 0, keep_age: Duration::ZERO, ..Limits::default() });
    service.resume();
    let (running, queued) = (submit(&service).await, submit(&service).await);
    let cancelled = submit(&service).await;
    service.cancel(&everybody(), &cancelled.id).await.unwrap();
    tokio::time::sleep(3 * TIDY).await;
    let left: Vec<String> = listed(&service).into_iter().map(|job| job.id).collect();
    assert_eq!(left, [queued.id, running.id]);
    assert_eq!((count(&folder, "jobs"), count(&folder, "scenes"), count(&folder, "results")), (2, 1, 0));
}

#[test]
fn a_job_that_is_being_written_counts_and_is_invisible() {
    let mut ledger = Ledger::new(Places { all: 0, of_a_client: 0 });
    let mut keyed = record(1);
    keyed.header.idempotency_key = "monday".into();
    let (first, second) = (ledger.announce(keyed.clone()), ledger.announce(record(2)));
    assert_eq!((first.sequence, second.sequence), (Sequence(1), Sequence(2)));
    assert_eq!(ledger.unfinished(&everybody()), 2);
    assert!(ledger.has_any_of(first.scene) && ledger.uses(first.scene, JobId(9)));
    assert!(ledger.is_arriving(&keyed) && !ledger.is_arriving(&record(2)), "no key is nobody's");
    let asked = first.id.to_string();
    assert!(ledger.view(&everybody(), &asked).is_err());
    assert!(!ledger.has_scene(&everybody(), first.scene), "its scene may not be there yet");
    ledger.dismiss(second.id);
    ledger.insert(first);
    assert!(!ledger.is_arriving(&keyed));
    assert_eq!(ledger.view(&everybody(), &asked).unwrap().state(), State::Queued);
    assert_eq!(ledger.unfinished(&everybody()), 1);
    assert_eq!(ledger.announce(record(3)).sequence, Sequence(2));
}
