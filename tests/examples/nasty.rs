//! Scenes that ask for trouble, of every family by turns, each baked and held to what must hold of every bake, and cancelled at a
//! random moment. Writes the scenes that break a promise to a folder, and fails when there are some.
//!
//!     cargo build --release -p coordinator && cargo measure nasty -- [SECONDS [TRIANGLES [SEED [FAMILY]]]]

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use tests::nasty::{Bake, End, Family, Nasty, bake, broken, most_seconds, nasty};
use tests::numbers::Numbers;

/// Where scenes that break a promise go.
const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../target/nasty");

/// Most seconds from a cancellation to the end.
const STOPPING: f64 = 2.0;

/// How much longer bakes may take whose options ask for much.
const MUCH: f64 = 10.0;

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |standard: u64| arguments.next().map_or(Ok(standard), |text| text.parse());
    let (seconds, triangles, first) = (number(600)?, number(2000)?, number(1)?);
    let only = arguments.next();
    let families: Vec<Family> = Family::ALL
        .into_iter()
        .filter(|family| only.as_ref().is_none_or(|only| *only == family.name()))
        .collect();
    if families.is_empty() {
        let known: Vec<String> = Family::ALL.iter().map(|family| family.name()).collect();
        return Err(format!("there is no such family: give one of {}", known.join(", ")).into());
    }
    let (clock, mut bakes, mut faults) = (Instant::now(), 0, 0);
    for seed in first.. {
        for &family in &families {
            if clock.elapsed() > Duration::from_secs(seconds) {
                println!("{bakes} scenes, {faults} of them break a promise");
                return Ok(if faults == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE });
            }
            let scene = nasty(family, seed, triangles as usize);
            let (baked, broken) = tried(&scene, seed);
            bakes += 1;
            println!(
                "{} {seed}: {} triangles, {:.2} s, {} MB, {:?} {}",
                family.name(),
                scene.triangles,
                baked.seconds,
                baked.peak_bytes / 1_000_000,
                baked.end,
                scene.options.join(" "),
            );
            if !broken.is_empty() {
                faults += 1;
                let path = Path::new(FOLDER).join(format!("{}-{seed}.glb", family.name()));
                fs::create_dir_all(FOLDER)?;
                fs::write(&path, &scene.glb)?;
                println!("    BROKEN: {}: {}", path.display(), broken.join("; "));
            }
        }
    }
    unreachable!("seeds do not end")
}

/// Bakes a scene, then again, cancelled at a moment of the time that it took.
fn tried(scene: &Nasty, seed: u64) -> (Bake, Vec<String>) {
    let most = most_seconds(scene.triangles) * if scene.asks_much { MUCH } else { 1.0 };
    let baked = bake(scene, None, Duration::from_secs_f64(most));
    let mut broken_by_both = broken(scene, &baked);
    if baked.end == End::TooLong {
        broken_by_both.push(format!("not done after {most:.0} s"));
    }
    let moment = baked.seconds * Numbers::new(seed).part();
    let cancelled = bake(scene, Some(Duration::from_secs_f64(moment)), Duration::from_secs_f64(most + 10.0));
    let stopping = cancelled.stopping_seconds.unwrap_or(0.0);
    if stopping > STOPPING {
        broken_by_both.push(format!("ended {stopping:.1} s after it was cancelled at {moment:.2} s"));
    }
    let by_cancelled = broken(scene, &cancelled).into_iter();
    broken_by_both.extend(by_cancelled.map(|what| format!("cancelled at {moment:.2} s: {what}")));
    (baked, broken_by_both)
}
