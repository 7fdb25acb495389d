//! Efficiency by workers, and what bends it.

use std::collections::BTreeMap;
use std::error::Error;

use crate::account::Cause;
use crate::model::Model;
use crate::scenes::{Named, Run, in_seconds};

/// Numbers of workers.
const WORKERS: [usize; 9] = [1, 2, 4, 8, 16, 32, 64, 128, 256];

/// Speed-up by workers, with where the rest went.
///
/// # Errors
/// When the scene cannot be baked.
pub fn scale(scene: &Named) -> Result<(), Box<dyn Error>> {
    let mut prepared = scene.prepare()?;
    // Whatever was not recorded is now.
    let first = prepared.run(Model::even(1))?;
    describe(scene, &first);
    let window = prepared.settings.window;
    for (slowness, window) in [(1.0, window), (1.0, 1024), (20.0, 1024)] {
        prepared.settings.window = window;
        println!("\nprocessor times x {slowness}, window {window}:\n");
        println!(
            "| workers | seconds | speed-up | efficiency | idle: coordinator | replicas | network | too few jobs | copies | dropped | most |"
        );
        println!("|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|");
        let alone = prepared.run(Model { slowness, ..Model::even(1) })?;
        for workers in WORKERS {
            let run = prepared.run(Model { slowness, ..Model::even(workers) })?;
            assert_eq!(run.digest, alone.digest, "the answer depends on the number of workers");
            line(workers, alone.seconds, &run);
        }
    }
    Ok(())
}

/// Efficiency at the numbers of workers that matter most, as a user has it: default settings.
///
/// # Errors
/// When the scene cannot be baked.
pub fn summary(scene: &Named) -> Result<(), Box<dyn Error>> {
    let mut prepared = scene.prepare()?;
    prepared.run(Model::even(1))?;
    let alone = prepared.run(Model::even(1))?;
    describe(scene, &alone);
    println!(
        "\n| workers | seconds | speed-up | efficiency | idle: coordinator | replicas | network | too few jobs | copies | dropped | most |"
    );
    println!("|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|");
    for (workers, latency) in [(4, 0), (16, 0), (64, 0), (256, 0), (4, 100_000_000), (16, 100_000_000)] {
        let even = Model::even(workers);
        let model = Model { latency: even.latency.max(latency / 2), ..even };
        let run = prepared.run(model)?;
        assert_eq!(run.digest, alone.digest, "the answer depends on the number of workers");
        if latency == 100_000_000 && workers == 4 {
            println!("\nround trips of 100 ms:\n");
        }
        line(workers, alone.seconds, &run);
        if workers == 256 {
            println!(
                "scheduler {:.2} us an event",
                run.account.scheduling as f64 / run.account.events as f64 * 1e-3
            );
        }
    }
    Ok(())
}

fn describe(scene: &Named, run: &Run) {
    let account = &run.account;
    let driver: u64 = account.driver.values().sum();
    println!(
        "\n## {}: {} vertices, {} shares, {} rows in {} jobs, {:.1} MB of rows\n",
        scene.name,
        run.report.vertices,
        run.report.shooting_vertices,
        run.report.rows,
        account.jobs,
        account.bytes as f64 / 1e6
    );
    let per_job = |time: u64| time as f64 / account.jobs as f64 * 1e-3;
    println!(
        "computing {:.2} s, {:.0} us a job; driver {:.3} s, {:.1} us a job; decoding {:.3} s; scheduler {:.1} us an event",
        in_seconds(account.compute),
        per_job(account.compute),
        in_seconds(driver),
        per_job(driver),
        in_seconds(account.decoding),
        account.scheduling as f64 / account.events as f64 * 1e-3
    );
    println!("of the driver {:.3} s on threads that share it", in_seconds(account.shared));
    let phases: Vec<String> =
        account.driver.iter().map(|(phase, time)| format!("{phase} {:.3} s", in_seconds(*time))).collect();
    println!("driver: {}", phases.join(", "));
    let steps = run.report.own_seconds.iter().map(|(step, seconds)| format!("{step} {seconds:.3} s"));
    println!("driver, wall time by step: {}", steps.collect::<Vec<_>>().join(", "));
    println!("{} shots, {} sweeps", run.report.shots, run.report.sweeps);
    let phases: Vec<String> =
        account.elapsed.iter().map(|(phase, time)| format!("{phase} {:.3} s", in_seconds(*time))).collect();
    println!("elapsed, one worker: {}", phases.join(", "));
}

/// Prints a line; parts are of the time of all workers.
fn line(workers: usize, alone: f64, run: &Run) {
    let all = run.seconds * workers as f64;
    let idle = |cause: Cause| {
        let of = run.account.idle.iter().filter(|((_, which), _)| *which == cause);
        in_seconds(of.map(|(_, time)| *time).sum()) / all
    };
    let mut most: Vec<(&(&'static str, Cause), &u64)> = run.account.idle.iter().collect();
    most.sort_by_key(|(_, time)| std::cmp::Reverse(**time));
    let most: BTreeMap<usize, String> = most
        .iter()
        .take(4)
        .enumerate()
        .map(|(place, ((phase, cause), time))| {
            (place, format!("{phase} {cause:?} {:.1} %", 100.0 * in_seconds(**time) / all))
        })
        .collect();
    println!(
        "| {workers} | {:.3} | {:.1} | {:.2} | {:.1} % | {:.1} % | {:.1} % | {:.1} % | {} | {} | {} |",
        run.seconds,
        alone / run.seconds,
        alone / all,
        100.0 * idle(Cause::Coordinator),
        100.0 * idle(Cause::Replica),
        100.0 * idle(Cause::Network),
        100.0 * idle(Cause::TooFewJobs),
        run.account.duplicates[0],
        run.account.duplicates[1],
        most.into_values().collect::<Vec<_>>().join(", ")
    );
}

/// What would bring more, each with all before it: how far a bake is from what it could be.
///
/// # Errors
/// When the scene cannot be baked.
pub fn limits(scene: &Named) -> Result<(), Box<dyn Error>> {
    let mut prepared = scene.prepare()?;
    prepared.run(Model::even(1))?;
    let alone = prepared.run(Model::even(1))?;
    describe(scene, &alone);
    type Change = fn(Model) -> Model;
    let changes: [(&str, Change); 6] = [
        ("replicas from the coordinator alone", |model| Model { passes: false, ..model }),
        ("passed from worker to worker", |model| Model { passes: true, ..model }),
        ("replicas travel in no time", |model| Model { free_replicas: true, ..model }),
        ("messages cost no processor time", |model| Model { per_message: 0, ..model }),
        ("10 Gbit/s", |model| Model { bandwidth: 1.25e9, ..model }),
        ("own arithmetic 4 times as fast", |model| Model { driver: 4, ..model }),
    ];
    for workers in [16, 64, 256] {
        println!("\n{workers} workers\n");
        println!(
            "| with | workers | seconds | speed-up | efficiency | idle: coordinator | replicas | network | too few jobs | copies | dropped | most |"
        );
        println!("|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|");
        let mut model = Model::even(workers);
        for (name, change) in changes {
            model = change(model);
            let run = prepared.run(model.clone())?;
            print!("| {name} ");
            line(workers, alone.seconds, &run);
        }
    }
    Ok(())
}

/// What one slow worker, or one that hangs, costs.
///
/// # Errors
/// When the scene cannot be baked.
pub fn slow(scene: &Named) -> Result<(), Box<dyn Error>> {
    let mut prepared = scene.prepare()?;
    println!("\n## {}: one worker of several is slow\n", scene.name);
    println!(
        "| workers | all even | one fewer | one ten times slower | one hangs | copies: even | slow | hangs |"
    );
    println!("|---:|---:|---:|---:|---:|---:|---:|---:|");
    for workers in [2, 4, 16, 64] {
        let mut with = |speed: Option<f64>| -> Result<Run, Box<dyn Error>> {
            let mut model = Model::even(workers - 1);
            model.workers.extend(speed);
            prepared.run(model)
        };
        let (even, fewer, slow, hangs) = (with(Some(1.0))?, with(None)?, with(Some(0.1))?, with(Some(0.0))?);
        println!(
            "| {workers} | {:.3} | {:.3} | {:.3} | {:.3} | {} | {} | {} |",
            even.seconds,
            fewer.seconds,
            slow.seconds,
            hangs.seconds,
            even.account.duplicates[0],
            slow.account.duplicates[0],
            hangs.account.duplicates[0]
        );
    }
    Ok(())
}

/// What more rows under way while shooting bring, and what they cost.
///
/// # Errors
/// When the scene cannot be baked.
pub fn window(scene: &Named) -> Result<(), Box<dyn Error>> {
    let mut prepared = scene.prepare()?;
    println!("\n## {}: seconds by window\n", scene.name);
    println!("| window | shots | sweeps | driver | 1 worker | 4 | 16 | 64 |");
    println!("|---:|---:|---:|---:|---:|---:|---:|---:|");
    for window in [16, 64, 256, 1024, 4096] {
        prepared.settings.window = window;
        let mut cells = vec![];
        let mut figures = String::new();
        for workers in [1, 4, 16, 64] {
            let run = prepared.run(Model::even(workers))?;
            cells.push(format!("{:.3}", run.seconds));
            let driver: u64 = run.account.driver.values().sum();
            figures = format!("{} | {} | {:.3}", run.report.shots, run.report.sweeps, in_seconds(driver));
        }
        println!("| {window} | {figures} | {} |", cells.join(" | "));
    }
    Ok(())
}
