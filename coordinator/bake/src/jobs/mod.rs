//! Jobs: rows of form factors, requested from a [`RowService`] and received.
//!
//! | file | what it does |
//! |---|---|
//! | `client` | submits jobs and receives their rows |
//! | `monitor` | progress, counters, cancellation |
//! | `sizes` | how many rows a job should have: pure |
//! | `time` | how the wall time divides: pure |

mod client;
mod monitor;
mod sizes;
mod time;

pub use client::{ReceiverSet, RowBatch, RowClient, RowService};
pub use time::{ThreadTime, TimeParts};
