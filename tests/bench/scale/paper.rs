//! The experiments that the method was first measured with, on the simulated cluster.

use std::error::Error;

use cluster::scheduler::Policy;

use crate::model::{Model, Where};
use crate::scenes::{Named, Run, in_seconds};

/// Periods between ticks, in milliseconds.
const PERIODS: [f64; 5] = [0.3, 1.0, 3.0, 10.0, 100.0];

/// Bytes of energy of a vertex: irradiance and what was shot, three channels each.
const ENERGY: u64 = 48;

/// Processor times are given as measured, and as on machines so many times slower.
const SLOWNESS: [f64; 2] = [1.0, 20.0];

/// Who shoots, and when jobs are sent.
///
/// # Errors
/// When the scene cannot be baked.
pub fn sharing(scene: &Named) -> Result<(), Box<dyn Error>> {
    let mut prepared = scene.prepare()?;
    let first = prepared.run(Model::even(1))?;
    let bytes = ENERGY * first.report.shooting_vertices as u64;
    println!("\n## {}: {} shares\n", scene.name, first.report.shooting_vertices);
    println!(
        "| times | workers | shooting here | remotely | here is faster by | by news | every .3 ms | 1 ms | 3 ms | 10 ms | 100 ms |"
    );
    println!("|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    for slowness in SLOWNESS {
        for workers in [2, 4, 8, 16] {
            let model = Model { slowness, ..Model::even(workers) };
            let here = prepared.run(model.clone())?;
            let there = prepared.run(Model { shooting: Where::Remotely { bytes }, ..model.clone() })?;
            let mut slower = vec![];
            for period in PERIODS {
                let period = (period * 1e6) as u64;
                let run = prepared.run(Model { policy: Policy::Periodic, period, ..model.clone() })?;
                assert_eq!(run.digest, first.digest, "the answer depends on the policy");
                slower.push(format!("{:+.1} %", 100.0 * (run.seconds / here.seconds - 1.0)));
            }
            println!(
                "| x {slowness} | {workers} | {:.3} | {:.3} | {:.0} % | {:.3} | {} |",
                shooting(&here),
                shooting(&there),
                100.0 * (shooting(&there) / shooting(&here) - 1.0),
                here.seconds,
                slower.join(" | "),
            );
        }
    }
    Ok(())
}

/// Seconds of the phase in which light is shot.
fn shooting(run: &Run) -> f64 {
    in_seconds(run.account.elapsed.get("shoot").copied().unwrap_or_default())
}
