//! The process of a job: it reads orders, runs the job, and says how it ended.
//!
//! | module | what lives there |
//! |---|---|
//! | `orders` | from the first order to the last word |
//! | `run` | the job, through the pipeline |
//! | `rows` | its rows, computed by the workers of the service |
//! | `observer`, `preview` | reports of the run, and previews |
//! | `world` | what it knows of workers and watchers |

mod observer;
mod orders;
mod preview;
mod rows;
mod run;
mod world;

pub use orders::run_job;
