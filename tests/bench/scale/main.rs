//! How a bake scales with workers, simulated: `cargo measure scale -- WHAT [SCENE...]`.
//!
//! | what | prints |
//! |---|---|
//! | scale | speed-up and efficiency by workers, and what idle threads wait for |
//! | summary | efficiency on 4, 16, 64 and 256 workers, and over round trips of 100 ms |
//! | limits | what faster replicas, messages, links or arithmetic would bring |
//! | slow | what one slow worker costs, or one that hangs |
//! | window | what more rows under way while shooting bring |
//! | paper | who shoots; jobs sent on news or by the period; energies apart or in the vertices |
//!
//! Scenes are `small`, `medium`, `large`, `checked` (large, with its error measured), `long` and `huge` (the same of sixteen rooms and of
//! 44), these with exact rows; `error` (eight rooms to an error of 3 %), `fine` (to one of 1 %) and `house` (under sun and sky, to an
//! error of 2 %). Where none is named, all but `huge`: its rows take forty minutes. Rows are recorded in `target/scale`: remove it
//! after a change of the kernels.
//!
//! The coordinator's code is the real one: bake, solver and scheduler. So are the rows and what they take, each measured once. The
//! cluster around them is simulated, event by event, with a clock of its own.

mod account;
mod cluster;
mod model;
mod paper;
mod processor;
mod recorder;
mod records;
mod scenes;
mod tables;

use std::error::Error;

use scenes::SCENES;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (what, names) = match arguments.split_first() {
        Some((what, names)) => (what.as_str(), names),
        None => ("scale", &[][..]),
    };
    let is_named = |name: &str| names.iter().any(|named| named == name);
    let mut scenes =
        SCENES.iter().filter(|scene| is_named(scene.name) || names.is_empty() && scene.name != "huge");
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    match what {
        "scale" => scenes.try_for_each(tables::scale),
        "summary" => scenes.try_for_each(tables::summary),
        "limits" => scenes.try_for_each(tables::limits),
        "slow" => scenes.try_for_each(tables::slow),
        "window" => scenes.try_for_each(tables::window),
        "paper" => {
            scenes.try_for_each(paper::sharing)?;
            records::compare();
            Ok(())
        }
        _ => Err("say scale, summary, limits, slow, window or paper, then names of scenes: small, medium, large, checked, long, huge, error, fine, house".into()),
    }
}
