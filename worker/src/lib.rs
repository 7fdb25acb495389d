//! The worker: replicas in, rows out.

pub mod engine;
