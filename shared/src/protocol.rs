//! The messages and services of `proto/radiosity/worker/v1`, generated at build time.

#![allow(missing_docs, clippy::all)]

tonic::include_proto!("radiosity.worker.v1");

/// Version of the protocol; both sides refuse to talk to another version.
pub const PROTOCOL_VERSION: u32 = 3;

/// Largest message that either side accepts, in bytes. A row of a million receivers takes 4 MiB, and jobs are cut long
/// before that.
pub const MAX_MESSAGE_BYTES: usize = 64 << 20;
