//! Whatever a worker refuses, the job alone fails, with the reason, and the next one runs.

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use cluster::scheduler::Abandonment;
use cluster::{AsyncCluster, ClusterError, JobId};
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::RowRequest;
use protocol::worker::worker_message::Body;
use protocol::worker::{
    FailureReason, Finished, JobFailed, PROTOCOL_VERSION, ReplicaHeader, RowJob, RowStatistics,
    digest_of_rows,
};
use tokio::io::{DuplexStream, copy_bidirectional, duplex};
use tokio::sync::watch;
use tokio::time::Instant;
use tonic::Status;
use worker::Settings;
use worker::pool::Compute;

use super::bakery::{Bakery, dark_rows};
use super::clock::{A, B, Process, SOON, Wires, is_there, large_replica, start, until};
use super::server::Fake;

fn dark(job: &RowJob) -> Option<Body> {
    let rows = dark_rows(job);
    let digest = digest_of_rows(&rows).to_bytes();
    let statistics = vec![RowStatistics::default(); job.shooters.len()];
    Some(Body::Finished(Finished { job_id: job.job_id, rows, statistics, digest }))
}

/// A job that needs this replica.
fn needs(replica: &EncodedReplica) -> RowRequest {
    RowRequest { receivers: replica.digest, receiver_count: 1, ..Bakery::new().requests()[0].clone() }
}

/// Has job 0 computed, which fails, and jobs after it, which do not. Returns the failure.
async fn fails_alone(cluster: &mut AsyncCluster, large: &EncodedReplica) -> (Abandonment, String) {
    let bakery = Bakery::new();
    bakery.replicas().into_iter().chain([large.clone()]).for_each(|replica| cluster.publish(replica));
    cluster.submit(vec![(JobId(0), needs(large))]);
    let Err(ClusterError::Abandoned { job: JobId(0), why, message }) = cluster.next().await else {
        panic!("job 0 does not fail")
    };
    cluster.release(large.digest);
    cluster.submit((1..).map(JobId).zip(bakery.requests()).collect());
    for _ in bakery.requests() {
        cluster.next().await.unwrap();
    }
    (why, message)
}

#[tokio::test(start_paused = true)]
async fn a_replica_beyond_the_limit_in_the_hello_is_not_sent() {
    let wires = Arc::new(Wires::default());
    let settings = Settings {
        compute: Compute::InTask { time: SOON },
        replica_bytes: 4 * 100_000,
        ..Settings::new("small", NonZeroUsize::MIN)
    };
    wires.set(A, Process::with(settings).leak().plain_door());
    let mut cluster = start(&wires, &[A]).await;
    let large = large_replica(10_000);
    assert!(large.bytes.len() > 100_000);
    let (why, message) = fails_alone(&mut cluster, &large).await;
    assert_eq!(why, Abandonment::ReplicaRefused);
    assert!(message.contains("takes 100000") && message.contains("--replica-bytes"), "{message}");
    let worker = until(&cluster, A, is_there).await;
    assert!(worker.connections == 1 && worker.bytes_sent < 100_000, "{worker:?}");
}

#[tokio::test(start_paused = true)]
async fn a_replica_that_one_worker_refuses_goes_to_another() {
    let wires = Arc::new(Wires::default());
    let settings = Settings {
        compute: Compute::InTask { time: SOON },
        replica_bytes: 4 * 100_000,
        ..Settings::new("small", NonZeroUsize::MIN)
    };
    wires.set(A, Process::with(settings).leak().plain_door());
    // It comes later: the job waits for it.
    wires.set(B, super::clock::refuses());
    let mut cluster = start(&wires, &[A, B]).await;
    let large = large_replica(10_000);
    Bakery::new().replicas().into_iter().chain([large.clone()]).for_each(|replica| cluster.publish(replica));
    cluster.submit(vec![(JobId(0), needs(&large))]);
    tokio::time::sleep(Duration::from_secs(1)).await;
    wires.set(B, Process::start(SOON).leak().plain_door());
    assert_eq!(cluster.next().await.unwrap().job, JobId(0));
    assert_eq!(until(&cluster, B, is_there).await.part.jobs, 1);
}

#[tokio::test(start_paused = true)]
async fn a_replica_that_a_worker_does_not_take_costs_its_job_alone() {
    for status in [
        Status::resource_exhausted("it is too large"),
        Status::invalid_argument("its bytes changed on the way"),
        Status::internal("the computation panicked"),
    ] {
        let wires = Arc::new(Wires::default());
        let (large, refusal) = (large_replica(100), status.clone());
        let refused = large.digest;
        let worker =
            Process::fake(Fake::new(
                dark,
                move |header| {
                    if of(header) == refused { Err(refusal.clone()) } else { Ok(()) }
                },
            ));
        wires.set(A, worker.plain_door());
        let mut cluster = start(&wires, &[A]).await;
        let (why, message) = fails_alone(&mut cluster, &large).await;
        assert_eq!((why, message.as_str()), (Abandonment::ReplicaRefused, status.message()));
        assert_eq!(until(&cluster, A, is_there).await.connections, 1);
    }
}

fn of(header: &ReplicaHeader) -> Digest {
    Digest::try_from(header.digest.as_ref()).unwrap()
}

/// A way to a worker that breaks whenever the number changes.
fn mortal(mut deaths: watch::Receiver<u32>, mut far: DuplexStream) -> DuplexStream {
    let (mut theirs, served) = duplex(1 << 16);
    tokio::spawn(async move {
        deaths.mark_unchanged();
        tokio::select! {
            _ = copy_bidirectional(&mut far, &mut theirs) => {}
            _ = deaths.changed() => {}
        }
    });
    served
}

#[tokio::test(start_paused = true)]
async fn a_replica_that_kills_workers_costs_its_job_alone() {
    let wires = Arc::new(Wires::default());
    let large = large_replica(100);
    let (deadly, (deaths, dead)) = (large.digest, watch::channel(0));
    let worker = Process::fake(Fake::new(dark, move |header| {
        if of(header) == deadly {
            deaths.send_modify(|times| *times += 1);
            return Err(Status::unavailable("killed"));
        }
        Ok(())
    }));
    let told = dead.clone();
    wires.set(A, worker.door(move |_, far| Some(mortal(told.clone(), far))));
    let mut cluster = start(&wires, &[A]).await;
    let (why, message) = fails_alone(&mut cluster, &large).await;
    assert_eq!(why, Abandonment::ReplicaRefused);
    assert!(message.contains("3 times in a row") && message.contains("memory"), "{message}");
    assert_eq!(*dead.borrow(), 3);
}

#[tokio::test(start_paused = true)]
async fn a_job_that_workers_do_not_do_fails_alone() {
    for (reason, expected) in [
        (FailureReason::InvalidJob, Abandonment::Refused),
        (FailureReason::Internal, Abandonment::FailedTooOften),
        (FailureReason::Cancelled, Abandonment::FailedTooOften),
        (FailureReason::Unspecified, Abandonment::FailedTooOften),
        (FailureReason::UnknownReplica, Abandonment::ReplicasForgotten),
    ] {
        let wires = Arc::new(Wires::default());
        let answer = move |job: &RowJob| match job.job_id {
            job_id @ 0 => {
                Some(Body::Failed(JobFailed { job_id, reason: reason.into(), message: "no".into() }))
            }
            _ => dark(job),
        };
        wires.set(A, Process::fake(Fake::new(answer, |_| Ok(()))).leak().plain_door());
        let mut cluster = start(&wires, &[A]).await;
        let (why, message) = fails_alone(&mut cluster, &large_replica(100)).await;
        assert_eq!((why, message.as_str()), (expected, "no"), "{reason:?}");
        assert_eq!(until(&cluster, A, is_there).await.connections, 1);
    }
}

/// A worker that answers garbage is set aside for a while only, where a service goes on.
#[tokio::test(start_paused = true)]
async fn a_job_that_workers_answer_with_garbage_fails_alone() {
    let wires = Arc::new(Wires::default());
    let answer = |job: &RowJob| match job.job_id {
        0 => Some(Body::Finished(Finished::default())),
        _ => dark(job),
    };
    wires.set(A, Process::fake(Fake::new(answer, |_| Ok(()))).leak().plain_door());
    let mut cluster = start(&wires, &[A]).await;
    let (why, message) = fails_alone(&mut cluster, &large_replica(100)).await;
    assert_eq!(why, Abandonment::KillsWorkers);
    assert!(message.contains("garbage"), "{message}");
}

#[tokio::test(start_paused = true)]
async fn a_worker_of_another_version_is_asked_again_once_it_may_be_replaced() {
    let wires = Arc::new(Wires::default());
    wires.set(A, Process::start(SOON).leak().plain_door());
    let old = Fake::new(dark, |_| Ok(())).of_version(PROTOCOL_VERSION - 1);
    let counted = Arc::new(AtomicU32::new(0));
    let counting = Arc::clone(&counted);
    wires.set(
        B,
        Process::fake(old).leak().door(move |_, far| {
            counting.fetch_add(1, Ordering::Relaxed);
            Some(far)
        }),
    );
    let cluster = start(&wires, &[A, B]).await;
    tokio::time::sleep(Duration::from_secs(30)).await;
    assert_eq!(
        counted.load(Ordering::Relaxed),
        2,
        "it is asked once, with a connection for jobs and one for uploads"
    );
    wires.set(B, Process::start(SOON).leak().plain_door());
    let began = Instant::now();
    until(&cluster, B, is_there).await;
    assert!(began.elapsed() < Duration::from_secs(31), "{:?}", began.elapsed());
}
