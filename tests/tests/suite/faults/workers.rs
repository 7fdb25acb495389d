use std::net::TcpListener;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use tests::programs::{Signal, WorkerProcess};

use super::{LONGER, assert_undisturbed, bake_by, wait_until_under_way, worker};

/// A worker that fell silent must be noticed so soon.
const NOTICED: Duration = Duration::from_secs(5);

/// An address at which nobody listens yet.
fn free_address() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().to_string()
}

#[test]
fn killed() {
    let (mut dies, lives) = (WorkerProcess::start(1), WorkerProcess::start(1));
    let mut solving = bake_by(&[&dies.address, &lives.address], &[]);
    wait_until_under_way(&mut solving);
    dies.kill();
    let solved = solving.finish();
    assert_undisturbed(&solved);
    assert!(worker(&solved, &dies.address)["lost"].is_string(), "{}", solved.report);
    assert!(solved.report["cluster"]["lost_workers"].as_u64().unwrap() >= 1);
}

/// Of a stopped process the socket stays open. Its work is done by the other, who does not wait for the loss to be noticed.
#[test]
fn stopped_beside_another() {
    let (hangs, lives) = (WorkerProcess::start(1), WorkerProcess::start(1));
    let mut solving = LONGER.bake_by(&[&hangs.address, &lives.address], &[]);
    wait_until_under_way(&mut solving);
    hangs.signal(Signal::STOP);
    let solved = solving.finish();
    hangs.signal(Signal::CONT);
    LONGER.assert_undisturbed(&solved);
    let (duplicates, lost) =
        (&solved.report["cluster"]["duplicates"], &worker(&solved, &hangs.address)["lost"]);
    assert!(duplicates.as_u64().unwrap() > 0 || lost.is_string(), "{}", solved.report);
}

/// The only worker is stopped: that is noticed, and when it goes on, so does the bake.
#[test]
fn stopped_alone_and_continued() {
    let hangs = WorkerProcess::start(1);
    let mut solving = bake_by(&[&hangs.address], &[]);
    wait_until_under_way(&mut solving);
    hangs.signal(Signal::STOP);
    let stopped = Instant::now();
    solving.wait_for("it is silent");
    let noticed = stopped.elapsed();
    hangs.signal(Signal::CONT);
    let solved = solving.finish();
    assert_undisturbed(&solved);
    assert!(noticed <= NOTICED, "noticed after {noticed:?}");
    assert!(worker(&solved, &hangs.address)["connections"].as_u64().unwrap() >= 2, "{}", solved.report);
}

/// A worker that is started anew at the same place holds no replicas, and gets them again.
#[test]
fn restarted_empty() {
    let mut dies = WorkerProcess::start(1);
    let address = dies.address.clone();
    let mut solving = bake_by(&[&address], &[]);
    wait_until_under_way(&mut solving);
    dies.kill();
    let _again = WorkerProcess::start_at(&address, 1, &[]);
    let solved = solving.finish();
    assert_undisturbed(&solved);
    let worker = worker(&solved, &address);
    assert!(worker["connections"].as_u64().unwrap() >= 2 && worker["lost"].is_null(), "{worker}");
}

/// A tenth of the time of its processor is all that one of them gets.
#[test]
fn ten_times_slower() {
    let (slow, fast) = (WorkerProcess::start(1), WorkerProcess::start(1));
    let solving = LONGER.bake_by(&[&slow.address, &fast.address], &[]);
    let over = AtomicBool::new(false);
    let solved = thread::scope(|scope| {
        scope.spawn(|| {
            while !over.load(Ordering::Relaxed) {
                slow.signal(Signal::STOP);
                thread::sleep(Duration::from_millis(90));
                slow.signal(Signal::CONT);
                thread::sleep(Duration::from_millis(10));
            }
        });
        let solved = solving.finish();
        over.store(true, Ordering::Relaxed);
        solved
    });
    LONGER.assert_undisturbed(&solved);
    let jobs = |address| worker(&solved, address)["jobs"].as_u64().unwrap();
    let (slow, fast) = (jobs(&slow.address), jobs(&fast.address));
    assert!(slow > 0 && fast > 2 * slow, "{slow} jobs of the slow worker, {fast} of the other");
}

/// It is dialled until it is there.
#[test]
fn joins_at_half_time() {
    let (first, late) = (WorkerProcess::start(1), free_address());
    let mut solving = LONGER.bake_by(&[&first.address, &late], &[]);
    wait_until_under_way(&mut solving);
    let late = WorkerProcess::start_at(&late, 1, &[]);
    let solved = solving.finish();
    LONGER.assert_undisturbed(&solved);
    assert!(worker(&solved, &late.address)["jobs"].as_u64().unwrap() > 0, "{}", solved.report);
}

/// Told to stop, it finishes what it computes and says goodbye.
#[test]
fn drains() {
    let (mut leaves, stays) = (WorkerProcess::start(1), WorkerProcess::start(1));
    let mut solving = bake_by(&[&leaves.address, &stays.address], &[]);
    wait_until_under_way(&mut solving);
    leaves.signal(Signal::TERM);
    assert!(leaves.wait().success());
    let solved = solving.finish();
    assert_undisturbed(&solved);
    let lost = worker(&solved, &leaves.address)["lost"].clone();
    assert!(lost.as_str().is_some_and(|why| why.contains("told to stop")), "{lost}");
}

#[test]
fn all_gone_and_back() {
    let mut dies = WorkerProcess::start(1);
    let address = dies.address.clone();
    let mut solving = bake_by(&[&address], &["--worker-grace", "600"]);
    wait_until_under_way(&mut solving);
    dies.kill();
    solving.wait_for("no worker is left");
    let _again = WorkerProcess::start_at(&address, 2, &[]);
    assert_undisturbed(&solving.finish());
}

#[test]
fn all_gone_for_good() {
    let mut dies = WorkerProcess::start(1);
    let mut solving = bake_by(&[&dies.address], &["--worker-grace", "0.5"]);
    wait_until_under_way(&mut solving);
    dies.kill();
    let solved = solving.finish();
    assert!(!solved.success && solved.lit.is_none(), "{}", solved.said);
    let words = ["error: ", "all workers are lost", &dies.address];
    assert!(words.iter().all(|word| solved.said.contains(word)), "{}", solved.said);
}

#[test]
fn all_gone_and_this_process_goes_on() {
    let mut dies = WorkerProcess::start(1);
    let arguments = ["--worker-grace", "0.5", "--fallback", "embedded"];
    let mut solving = bake_by(&[&dies.address], &arguments);
    wait_until_under_way(&mut solving);
    dies.kill();
    let solved = solving.finish();
    assert_undisturbed(&solved);
    assert!(worker(&solved, "this process")["jobs"].as_u64().unwrap() > 0, "{}", solved.report);

    // The same where there never was anybody.
    let nobody = bake_by(&[&free_address()], &arguments).finish();
    assert_undisturbed(&nobody);
}
