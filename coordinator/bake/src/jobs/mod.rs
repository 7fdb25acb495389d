//! Jobs: rows of form factors, requested from a [`RowService`] and received.
//!
//! | file | what it does |
//! |---|---|
//! | `client` | submits jobs and receives their rows |
//! | `service` | [`RowService`]: whatever computes them |
//! | `plan` | what rows are over, and how they are cut: pure |
//! | `monitor` | progress, counters, cancellation |
//! | `sizes` | how many rows a job should have: pure |
//! | `time` | how the wall time divides: pure |

mod client;
mod monitor;
mod plan;
mod service;
mod sizes;
#[cfg(test)]
mod tests;
mod time;

pub use client::{RowBatch, RowClient};
pub use monitor::Monitor;
pub use plan::ReceiverSet;
pub use service::RowService;
pub use time::ThreadTime;
