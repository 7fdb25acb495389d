//! How exact a bake is for the time that it takes, knob by knob: a work-precision study against a path-traced reference.
//!
//! All of it is pure: the runs themselves, with their clocks, processes and files, are the command line's.
//!
//! | module | what it has |
//! |---|---|
//! | `plan` | [`plan()`]: which runs, in which order |
//! | `measurement` | [`Measurement`]: what one run showed; the CSV |
//! | `curve` | [`Point`]: medians of equal runs; [`time_to`]: the time at which a curve meets an error |
//! | `seeds` | [`SeedFigures`]: bias and spread over seeds |
//! | `table` | [`markdown`]: the tables |
//! | `plot` | [`svg`]: error over time, one curve a knob |

mod curve;
mod measurement;
mod plan;
mod plot;
mod seeds;
mod table;
#[cfg(test)]
mod test_measurements;

use crate::picture::Flip;

pub use curve::{Point, TimeTo, median, points, time_to};
pub use measurement::{Measurement, RunReport, to_csv};
pub use plan::{Curve, Part, PlanSize, Setting, Step, plan};
pub use plot::{PlotError, svg};
pub use seeds::{SeedFigures, seed_figures};
pub use table::markdown;

/// Scene, machine and settings of a study, for the headings of tables and plot.
#[derive(Debug, Clone, PartialEq)]
pub struct Circumstances {
    /// The scene's file name.
    pub scene: String,
    /// The reference's file name.
    pub reference: String,
    /// Name and version of the program.
    pub program: String,
    /// Processor, cores and operating system.
    pub machine: String,
    /// Who computed the rows, such as `2 threads`.
    pub workers: String,
    /// Runs of each setting.
    pub runs: u32,
    /// FLIP between two halves of the paths of the path-traced pictures, each of twice the variance of both; none without pictures.
    pub noise: Option<Flip>,
}
