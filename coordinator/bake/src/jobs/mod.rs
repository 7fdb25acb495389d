//! Jobs: rows of form factors, requested from a [`RowService`] and received.
//!
//! | file | what it does |
//! |---|---|
//! | `client` | submits jobs and receives their rows |
//! | `monitor` | progress, counters, cancellation |
//! | `sizes` | how many rows a job should have: pure |

mod client;
mod monitor;
mod sizes;

pub use client::{ReceiverSet, RowBatch, RowClient, RowService};
