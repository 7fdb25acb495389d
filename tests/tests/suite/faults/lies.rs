use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use kernel::row::{Row, encode_row};
use protocol::worker::worker_message::Body;
use protocol::worker::{Finished, PROTOCOL_VERSION, digest_of_rows};
use tests::programs::WorkerProcess;

use super::fake::{FakeWorker, Nature};
use super::{assert_undisturbed, bake_by, worker};

/// The liar does well for so many jobs.
const HONEST_JOBS: u64 = 20;

/// Bakes with an honest worker and with one that, after some honest answers, spoils one. The bytes must be as ever, and the
/// spoiler named and left alone.
fn assert_isolated(why: &str, spoil: impl Fn(Finished) -> Vec<Finished> + Send + Sync + 'static) {
    let jobs = AtomicU64::new(0);
    let liar = FakeWorker::start(Nature::answering(move |_, honest| match honest {
        Body::Finished(finished) if jobs.fetch_add(1, Ordering::Relaxed) >= HONEST_JOBS => {
            Some(spoil(finished).into_iter().map(Body::Finished).collect())
        }
        honest => Some(vec![honest]),
    }));
    let honest = WorkerProcess::start(1);
    let solved = bake_by(&[&liar.address, &honest.address], &[]).finish();
    assert_undisturbed(&solved);
    let liar = worker(&solved, &liar.address);
    assert!(liar["lost"].as_str().is_some_and(|lost| lost.contains(why)), "{liar}");
    assert_eq!(liar["connections"], 1, "it is asked again: {liar}");
    assert!(solved.said.contains("it is not asked again") && solved.said.contains(why), "{}", solved.said);
}

#[test]
fn garbage_for_rows() {
    assert_isolated("garbage", |finished| {
        let rows: Vec<_> = finished.rows.iter().map(|_| vec![0xff; 40].into()).collect();
        let digest = digest_of_rows(&rows).to_bytes();
        vec![Finished { rows, digest, ..finished }]
    });
}

#[test]
fn rows_that_changed_on_the_way() {
    assert_isolated("digest", |finished| {
        // Rows that could be right, but for the digest.
        let rows = finished.rows.iter().map(|_| encode_row(&Row::new(&[]))).collect();
        vec![Finished { rows, ..finished }]
    });
}

#[test]
fn the_same_answer_twice() {
    assert_isolated("which it does not hold", |finished| vec![finished.clone(), finished]);
}

#[test]
fn the_wrong_replica() {
    let liar = FakeWorker::start(Nature { mixes_replicas_up: true, ..Nature::honest() });
    let honest = WorkerProcess::start(1);
    let solved = bake_by(&[&liar.address, &honest.address], &[]).finish();
    assert_undisturbed(&solved);
    let liar = worker(&solved, &liar.address);
    assert!(liar["lost"].as_str().is_some_and(|lost| lost.contains("could not be loaded")), "{liar}");
    assert_eq!((&liar["jobs"], &liar["connections"]), (&0.into(), &1.into()), "{liar}");
}

#[test]
fn another_version() {
    let stranger = FakeWorker::start(Nature { protocol_version: PROTOCOL_VERSION + 1, ..Nature::honest() });
    let honest = WorkerProcess::start(1);
    let solved = bake_by(&[&stranger.address, &honest.address], &[]).finish();
    assert_undisturbed(&solved);
    let words = [stranger.address.as_str(), "protocol version", "install the same release"];
    assert!(words.iter().all(|word| solved.said.contains(word)), "{}", solved.said);
}

/// One job in ten takes a third of a second there: another worker has done it long before, and the late answer is dropped.
#[test]
fn late_answers() {
    let jobs = AtomicU64::new(0);
    let late = FakeWorker::start(Nature::answering(move |_, honest| {
        if jobs.fetch_add(1, Ordering::Relaxed) % 10 == 9 {
            thread::sleep(Duration::from_millis(300));
        }
        Some(vec![honest])
    }));
    let honest = WorkerProcess::start(1);
    let solved = bake_by(&[&late.address, &honest.address], &[]).finish();
    assert_undisturbed(&solved);
    let late = worker(&solved, &late.address);
    assert!(late["late"].as_u64().unwrap() > 0, "{late}");
    assert!(solved.report["cluster"]["duplicates"].as_u64().unwrap() > 0, "{}", solved.report["cluster"]);
}
