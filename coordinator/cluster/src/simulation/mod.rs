//! A bake on workers that crash, hang and come back, on a simulated network and clock; see docs/simulation.md.
//!
//! | module | contents |
//! |---|---|
//! | `room` | the scene: a small room, its shares and replicas |
//! | `driver` | a small bake: shots chosen from the rows of earlier ones, then rows over more receivers |
//! | `network` | names, connections and listeners of the simulation |
//! | `plan` | what goes wrong when, from a seed |
//! | `run` | one simulation from its first step to its last |
//! | `watch` | invariants after every event, and the trace |
//!
//! The cluster, the workers and the gRPC between them are those of the product. The network below and the clock are simulated, and
//! the task that requests a job computes it, with the answer some simulated time later.

mod driver;
mod network;
mod plan;
mod room;
mod run;
mod watch;

use std::process::{Command, Output};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use run::Outcome;
use watch::Counts;

/// Seeds of one test run.
const SEEDS: u64 = 200;

/// Names the seed of the only simulation to run.
const SEED: &str = "HALFLIGHT_SEED";

/// Begins the last line that a simulation prints.
const COUNTS: &str = "counts";

/// The seed that was asked for.
fn wanted() -> Option<u64> {
    std::env::var(SEED).ok().map(|seed| seed.parse().expect("HALFLIGHT_SEED is a whole number"))
}

/// Runs the simulation of one seed in a process of its own: the runtime numbers its tasks throughout a process, and ends those of a
/// machine that crashes in an order that depends on the numbers.
fn in_own_process(seed: u64) -> Output {
    let program = std::env::current_exe().expect("a running program has a path");
    let arguments = ["simulation::one_seed", "--exact", "--nocapture", "--test-threads=1"];
    Command::new(program)
        .args(arguments)
        .env(SEED, seed.to_string())
        .output()
        .expect("it can be started again")
}

/// The trace in what a simulation printed, or why it failed.
fn trace(output: &Output) -> Result<String, String> {
    let printed = String::from_utf8_lossy(&output.stdout);
    match printed.split_once(COUNTS) {
        Some((trace, _)) if output.status.success() => Ok(trace.into()),
        _ => Err(format!("{printed}{}", String::from_utf8_lossy(&output.stderr))),
    }
}

/// Looks at each seed, on all processors. Returns those that fail, and why.
fn failures(seeds: u64, look: impl Fn(u64) -> Result<(), String> + Sync) -> Vec<(u64, String)> {
    let failures = Mutex::new(vec![]);
    let next = AtomicU64::new(0);
    let work = || {
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds {
                return;
            }
            if let Err(failure) = look(seed) {
                failures.lock().unwrap().push((seed, failure));
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(work);
        }
    });
    let mut failures = failures.into_inner().unwrap();
    failures.sort();
    failures
}

/// Runs the simulation that `HALFLIGHT_SEED` names, and prints what happened in it. Without it there is nothing to do.
#[test]
fn one_seed() {
    let Some(seed) = wanted() else { return };
    let Outcome { trace, counts, end } = run::run(seed);
    println!("{}", trace.join("\n"));
    match end {
        Ok(bits) => assert!(bits == driver::undisturbed(), "seed {seed}: the end state has other bits"),
        Err(failure) => panic!("seed {seed}: {failure}"),
    }
    println!("{COUNTS} {counts}");
}

#[test]
fn whatever_fails_the_bits_are_the_same() {
    if wanted().is_some() {
        return;
    }
    let total = Mutex::new(Counts::default());
    let failed = failures(SEEDS, |seed| {
        let output = in_own_process(seed);
        trace(&output)?;
        let printed = String::from_utf8_lossy(&output.stdout);
        let counts = printed.rsplit(COUNTS).next().and_then(Counts::parse).ok_or("it prints no counts")?;
        total.lock().unwrap().add(&counts);
        Ok(())
    });
    let counts = total.into_inner().unwrap();
    println!("{SEEDS} seeds: {counts:?}");
    if let Some((seed, failure)) = failed.first() {
        let seeds: Vec<u64> = failed.iter().map(|(seed, _)| *seed).collect();
        panic!(
            "{} of {SEEDS} seeds fail, {seeds:?}; the first of them again: {SEED}={seed}\n{failure}",
            failed.len()
        );
    }
    // The simulation would prove nothing if nothing went wrong in it.
    assert!(counts.lost_workers > SEEDS && counts.orderly > SEEDS / 10, "{counts:?}");
    assert!(counts.sent_again > SEEDS && counts.passed > SEEDS, "{counts:?}");
}

#[test]
fn the_same_seed_gives_the_same_trace() {
    if wanted().is_some() {
        return;
    }
    if !cfg!(tokio_unstable) {
        println!(
            "skipped: RUSTFLAGS take the place of those in .cargo/config.toml, without which nothing is the same twice"
        );
        return;
    }
    let failed = failures(20, |seed| {
        let [first, second] = [trace(&in_own_process(seed))?, trace(&in_own_process(seed))?];
        let differs = first.lines().zip(second.lines()).find(|(a, b)| a != b);
        match differs {
            Some((a, b)) => Err(format!("{a}\n{b}")),
            None if first.len() != second.len() => Err("one trace is longer".into()),
            None => Ok(()),
        }
    });
    assert!(failed.is_empty(), "{failed:#?}");
}
