//! Assigns jobs to workers. Pure: events in, actions out; no socket, no clock, no thread.
//!
//! | module | contents |
//! |---|---|
//! | `state` | [`Scheduler`]: jobs and workers, and what events change |
//! | `event` | events in, actions out, policies |
//! | `job` | state of a job; the queue |
//! | `worker` | state of a worker |
//! | `held` | a job that a worker holds; where a worker stands |
//! | `index` | workers and their jobs in the orders that choices ask for |
//! | `choice` | which job goes next, and to which worker |
//! | `turns` | the handle whose job goes next |
//! | `spread` | which replica goes on its way next, and from whom |
//! | `duplicates` | copies of late jobs for idle workers |
//! | `limits` | when jobs are suspected or given up |
//! | `checking` | invariants between any two events |
//!
//! Load sharing: a worker holds a bounded number of jobs and gets the next one when it finishes one, so a fast worker gets more
//! of them. It holds more jobs than it has threads, so that a thread that finishes goes on at once; how many more depends on how far
//! away it is, in jobs ([`room`]).
//!
//! Replicas are loaded to a worker when it has room for a job that needs them; meanwhile it gets other jobs.

mod checking;
mod choice;
mod duplicates;
mod event;
mod held;
mod index;
mod job;
mod limits;
mod room;
mod spread;
mod state;
mod turns;
mod worker;

#[cfg(test)]
mod tests;

pub use event::{Abandonment, Action, Event, PassOutcome, Policy, WorkerId};
pub use kernel::row::JobId;
pub use limits::{MOST_FAILURES, MOST_LOSSES_ALONE, MOST_RELOADS, SUSPECT_LOSSES};
pub use room::room;
pub use spread::patience;
pub use state::Scheduler;
pub use turns::{HandleId, Turns};
