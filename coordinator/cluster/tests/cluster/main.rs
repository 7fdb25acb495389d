//! A cluster of real and fake workers.

mod bakery;
mod clock;
mod names;
mod passing;
mod refusals;
mod server;
mod sharing;

use std::time::Duration;

use bake::RowService;
use cluster::scheduler::Abandonment;
use cluster::{Cluster, ClusterError, ClusterSettings, Handle, JobId, Workers};
use kernel::replica::Digest;
use kernel::row::{ROW_VERSION, RowRequest};
use prometheus_client::encoding::text::encode;
use prometheus_client::registry::Registry;
use protocol::worker::worker_message::Body;
use protocol::worker::{FailureReason, Finished, JobFailed, RowJob, RowStatistics, digest_of_rows};

use bakery::{Bakery, submit_all, take_all};
use server::Server;

/// A cluster of these servers, and a handle to it that has published the replicas.
fn cluster(servers: &[&Server], bakery: &Bakery) -> (Cluster, Handle) {
    with_handle(&settings(servers.iter().map(|server| server.address.clone())), bakery)
}

fn with_handle(settings: &ClusterSettings, bakery: &Bakery) -> (Cluster, Handle) {
    let cluster = Cluster::start(settings).unwrap();
    let mut handle = cluster.handle(0);
    bakery.publish(&mut handle);
    (cluster, handle)
}

/// A cluster of these workers that does not wait long for lost ones.
fn settings(addresses: impl Iterator<Item = String>) -> ClusterSettings {
    ClusterSettings { grace: Duration::from_millis(600), ..Workers::Remote(addresses.collect()).into() }
}

fn start_error(addresses: &[&str]) -> ClusterError {
    Cluster::start(&settings(addresses.iter().map(ToString::to_string))).err().unwrap()
}

#[test]
fn embedded_and_remote_workers_give_the_rows_of_the_engine() {
    let bakery = Bakery::new();
    let expected = bakery.rows();

    let embedded = with_handle(&Workers::Embedded { threads: 2 }.into(), &bakery);
    let servers = [Server::real(), Server::real()];
    let remote = cluster(&[&servers[0], &servers[1]], &bakery);
    for (cluster, mut handle) in [embedded, remote] {
        submit_all(&mut handle, &bakery);
        assert_eq!(take_all(&mut handle, &bakery), expected);
        let summaries = cluster.workers();
        assert_eq!(summaries.iter().map(|worker| worker.part.jobs).sum::<u64>(), expected.len() as u64);
        assert!(summaries.iter().all(|worker| (worker.part.jobs > 0) == (worker.part.bytes_received > 0)));
        assert!(summaries.iter().all(|worker| worker.lost.is_none()));
        cluster.shutdown();
    }
}

#[test]
fn a_wrong_address_is_named_with_the_cure() {
    // Bound but not listened on by anybody: nobody else gets the port meanwhile.
    let closed = tokio::net::TcpSocket::new_v4().unwrap();
    closed.bind("127.0.0.1:0".parse().unwrap()).unwrap();
    let address = closed.local_addr().unwrap().to_string();
    let error = start_error(&[&address]);
    assert!(matches!(error, ClusterError::Unreachable { .. }), "{error}");
    assert!(error.to_string().contains(&address) && error.to_string().contains("worker --listen"), "{error}");

    for malformed in ["127.0.0.1", "worker", ":7070", "http://worker:7070", "worker:70700"] {
        assert_eq!(start_error(&[malformed]), ClusterError::Address { address: malformed.into() });
    }
    assert_eq!(start_error(&[]), ClusterError::NoWorkers);
    assert_eq!(
        Cluster::start(&Workers::Embedded { threads: 0 }.into()).err().unwrap(),
        ClusterError::NoWorkers
    );
}

#[test]
fn a_worker_of_another_version_is_refused() {
    let server = Server::fake(99, |_| None);
    let error = start_error(&[&server.address]);
    let ClusterError::Version { mismatch, .. } = &error else { panic!("{error}") };
    assert_eq!((mismatch.theirs, mismatch.ours), (99, protocol::worker::PROTOCOL_VERSION));
}

#[test]
fn a_worker_of_another_row_version_is_refused() {
    // 0 is what a release sends that does not know the field.
    for theirs in [0, ROW_VERSION + 1] {
        let server = Server::of_row_version(theirs);
        let error = start_error(&[&server.address]);
        let ClusterError::Version { address, .. } = &error else { panic!("{error}") };
        assert_eq!(*address, server.address);
        let (theirs, ours) =
            (format!("row version {theirs}"), format!("this coordinator version {ROW_VERSION}"));
        for words in [theirs.as_str(), &ours, "install the same release"] {
            assert!(error.to_string().contains(words), "{error}");
        }
    }
}

#[test]
fn a_peer_that_is_no_worker_is_refused() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let stranger = std::thread::spawn(move || {
        use std::io::Write;
        let (mut caller, _) = listener.accept().unwrap();
        caller.write_all(b"HTTP/1.0 400 Bad Request\r\n\r\n").unwrap();
    });
    let error = start_error(&[&address]);
    assert!(error.to_string().contains(&address), "{error}");
    stranger.join().unwrap();
}

#[test]
fn a_worker_that_stops_hands_its_jobs_back() {
    let bakery = Bakery::new();
    let [stops, stays] = [Server::real(), Server::real()];
    let (_cluster, mut handle) = cluster(&[&stops, &stays], &bakery);
    submit_all(&mut handle, &bakery);
    stops.stop();
    assert_eq!(take_all(&mut handle, &bakery), bakery.rows());
}

#[test]
fn all_workers_lost_is_an_error_and_stays_one() {
    let bakery = Bakery::new();
    // Takes jobs, and never answers them.
    let mut servers = vec![Server::fake_worker(|_| None), Server::fake_worker(|_| None)];
    let (cluster, mut handle) = cluster(&[&servers[0], &servers[1]], &bakery);
    submit_all(&mut handle, &bakery);
    servers.clear();
    let Err(ClusterError::AllWorkersLost { reasons }) = handle.next() else { panic!("not lost") };
    assert_eq!(reasons.len(), 2);
    submit_all(&mut handle, &bakery);
    assert!(matches!(handle.next(), Err(ClusterError::AllWorkersLost { .. })));
    assert!(cluster.workers().iter().all(|worker| worker.lost.is_some()));
}

#[test]
fn a_worker_that_falls_silent_is_lost() {
    let bakery = Bakery::new();
    let server = Server::deaf();
    let (_cluster, mut handle) = cluster(&[&server], &bakery);
    submit_all(&mut handle, &bakery);
    let error = handle.next().unwrap_err();
    assert!(error.to_string().contains("silent"), "{error}");
}

#[test]
fn garbage_costs_a_worker_its_place_and_no_job_its_rows() {
    let bakery = Bakery::new();
    let finished = |job_id, rows: Vec<_>, statistics| {
        let digest = digest_of_rows(&rows).to_bytes();
        Some(Body::Finished(Finished { job_id, rows, statistics, digest }))
    };
    let honest = Server::real();
    let costs = |job: &RowJob| vec![RowStatistics::default(); job.shooters.len()];
    let liars = [
        // No row, a row with a byte too much, statistics missing, the answer to another job, a digest of other rows.
        Server::fake_worker(move |job| finished(job.job_id, vec![], costs(job))),
        Server::fake_worker(move |job| {
            finished(job.job_id, vec![vec![0].into(); job.shooters.len()], costs(job))
        }),
        Server::fake_worker(move |job| finished(job.job_id, bakery::dark_rows(job), vec![])),
        Server::fake_worker(move |job| finished(job.job_id + 1000, bakery::dark_rows(job), costs(job))),
        Server::fake_worker(move |job| {
            let (rows, digest) = (bakery::dark_rows(job), digest_of_rows(&[]).to_bytes());
            Some(Body::Finished(Finished { job_id: job.job_id, rows, statistics: costs(job), digest }))
        }),
    ];
    for liar in &liars {
        let (_cluster, mut alone) = cluster(&[liar], &bakery);
        submit_all(&mut alone, &bakery);
        let error = alone.next().unwrap_err();
        assert!(matches!(error, ClusterError::AllWorkersLost { .. }), "{error}");
        assert!(error.to_string().contains("garbage"), "{error}");

        let (_cluster, mut both) = cluster(&[liar, &honest], &bakery);
        submit_all(&mut both, &bakery);
        assert_eq!(take_all(&mut both, &bakery), bakery.rows());
    }
}

#[test]
fn a_replica_that_a_worker_forgot_is_loaded_again() {
    let bakery = Bakery::new();
    let server = Server::real();
    let (cluster, mut handle) = cluster(&[&server], &bakery);
    for _ in 0..2 {
        submit_all(&mut handle, &bakery);
        assert_eq!(take_all(&mut handle, &bakery), bakery.rows());
        server.forget(&bakery.digests());
    }
    assert_eq!(cluster.workers()[0].lost, None);
}

#[test]
fn a_released_replica_can_be_published_again() {
    let bakery = Bakery::new();
    let cluster = Cluster::start(&Workers::Embedded { threads: 1 }.into()).unwrap();
    let mut handle = cluster.handle(0);
    for _ in 0..2 {
        bakery.publish(&mut handle);
        submit_all(&mut handle, &bakery);
        assert_eq!(take_all(&mut handle, &bakery), bakery.rows());
        bakery.digests().into_iter().for_each(|digest| handle.release(digest));
    }
    // It is forgotten once every handle has released it as often as it was published.
    let mut other = cluster.handle(0);
    bakery.publish(&mut handle);
    bakery.publish(&mut handle);
    bakery.publish(&mut other);
    bakery.digests().into_iter().for_each(|digest| handle.release(digest));
    drop(handle);
    submit_all(&mut other, &bakery);
    assert_eq!(take_all(&mut other, &bakery), bakery.rows());
    bakery.digests().into_iter().for_each(|digest| other.release(digest));
    submit_all(&mut other, &bakery);
    assert!(matches!(other.next(), Err(ClusterError::NotPublished(_))));
}

#[test]
fn answers_to_withdrawn_jobs_are_no_duplicates() {
    let bakery = Bakery::new();
    let server = Server::real();
    let settings = settings(std::iter::once(server.address.clone()));
    let mut registry = Registry::default();
    settings.metrics.register(&mut registry);
    let (cluster, mut handle) = with_handle(&settings, &bakery);
    submit_all(&mut handle, &bakery);
    handle.next().unwrap();
    handle.withdraw();
    // The worker answers in order: those that it held of the withdrawn jobs before these.
    let requests = bakery.requests();
    let count = requests.len();
    handle.submit((1000..).map(JobId).zip(requests).collect());
    (0..count).for_each(|_| assert!(handle.next().unwrap().job.0 >= 1000));
    assert_eq!(cluster.workers()[0].late, 0);
    let mut text = String::new();
    encode(&mut text, &registry).unwrap();
    let line = "halflight_coordinator_duplicates_dropped_total 0";
    assert!(text.lines().any(|found| found == line), "{text}");
}

#[test]
fn a_job_that_cannot_be_done_is_reported() {
    let bakery = Bakery::new();
    let failing = Server::fake_worker(|job| {
        let reason = FailureReason::Internal.into();
        Some(Body::Failed(JobFailed { job_id: job.job_id, reason, message: "out of luck".into() }))
    });
    let (_failing, mut failing) = cluster(&[&failing], &bakery);
    failing.submit(vec![(JobId(1), bakery.requests()[0].clone())]);
    let why = Abandonment::FailedTooOften;
    let error = ClusterError::Abandoned { job: JobId(1), why, message: "out of luck".into() };
    assert_eq!(failing.next(), Err(error));

    let (_cluster, mut handle) = with_handle(&Workers::Embedded { threads: 1 }.into(), &bakery);
    let beyond = RowRequest { receiver_count: 1 << 20, ..bakery.requests()[0].clone() };
    handle.submit(vec![(JobId(1), beyond)]);
    let Err(ClusterError::Abandoned { why: Abandonment::Refused, message, .. }) = handle.next() else {
        panic!("not refused")
    };
    assert!(message.contains("do not exist"), "{message}");

    let unknown = Digest::of(b"never published");
    handle.submit(vec![(JobId(2), RowRequest { scene: unknown, ..bakery.requests()[0].clone() })]);
    assert_eq!(handle.next(), Err(ClusterError::NotPublished(unknown)));
}
