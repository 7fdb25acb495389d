//! The messages and services of `proto/radiosity/worker/v1`, generated at build time.

#![allow(missing_docs, clippy::all)]

use bytes::Bytes;

use kernel::replica::Digest;

pub use kernel::messages::*;

tonic::include_proto!("radiosity.worker.v1");

/// The protocol in its own words: an encoded `FileDescriptorSet`, for reflection.
pub const DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/worker-descriptors.bin"));

/// Version of the protocol; both sides refuse to talk to another version.
pub const PROTOCOL_VERSION: u32 = 5;

/// Largest message that either side accepts, in bytes. A row of a million receivers takes 4 MiB, and jobs are cut long
/// before that.
pub const MAX_MESSAGE_BYTES: usize = 64 << 20;

/// Digest of the encoded rows of a job, as it stands in [`Finished::digest`].
#[must_use]
pub fn digest_of_rows(rows: &[Bytes]) -> Digest {
    let mut hasher = blake3::Hasher::new();
    for row in rows {
        hasher.update(&(row.len() as u64).to_le_bytes()).update(row);
    }
    Digest(*hasher.finalize().as_bytes())
}
