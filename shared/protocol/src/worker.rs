//! The messages and services of `proto/radiosity/worker/v1`, generated at build time.

#![allow(missing_docs, clippy::all)]

use bytes::Bytes;

use kernel::replica::Digest;
use kernel::row::ROW_VERSION;

pub use kernel::messages::*;

tonic::include_proto!("radiosity.worker.v1");

/// Encoded `FileDescriptorSet` of the protocol, for reflection.
pub const DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/worker-descriptors.bin"));

/// Version of the protocol. Both sides refuse a peer of another version, see [`check_versions`].
pub const PROTOCOL_VERSION: u32 = 9;

/// Largest message that either side accepts, in bytes. A row of a million receivers takes 4 MiB, and jobs are cut long before that.
pub const MAX_MESSAGE_BYTES: usize = 64 << 20;

/// Computes [`Finished::digest`] of the encoded rows of a job.
#[must_use]
pub fn digest_of_rows(rows: &[Bytes]) -> Digest {
    let mut hasher = blake3::Hasher::new();
    for row in rows {
        hasher.update(&(row.len() as u64).to_le_bytes()).update(row);
    }
    Digest(*hasher.finalize().as_bytes())
}

/// A peer that cannot take part, because its messages or its rows are of another version.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{kind} version {theirs}, this {program} version {ours}: install the same release on both machines")]
pub struct VersionMismatch {
    /// Verb and version that differs.
    kind: &'static str,
    /// The peer's version; 0 where its release does not send one.
    pub theirs: u32,
    /// The version of this program.
    pub ours: u32,
    /// Kind of this program.
    program: &'static str,
}

/// Compares the versions in a peer's hello with those of this program, which is a `program`.
///
/// # Errors
/// When one of them differs. The message has the peer for its subject.
pub fn check_versions(
    program: &'static str,
    protocol_version: u32,
    row_version: u32,
) -> Result<(), VersionMismatch> {
    let versions = [
        ("speaks protocol", protocol_version, PROTOCOL_VERSION),
        ("computes with row", row_version, ROW_VERSION),
    ];
    match versions.into_iter().find(|(_, theirs, ours)| theirs != ours) {
        Some((kind, theirs, ours)) => Err(VersionMismatch { kind, theirs, ours, program }),
        None => Ok(()),
    }
}
