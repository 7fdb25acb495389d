//! The messages and the service of `proto/radiosity/v1`, generated at build time: what clients ask of a long-running
//! coordinator. `docs/protocol.md` says how they may change.

#![allow(missing_docs, clippy::all)]

tonic::include_proto!("radiosity.v1");

/// The API in its own words: an encoded `FileDescriptorSet`, for reflection.
pub const DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/api-descriptors.bin"));

/// Most bytes of a chunk, in either direction.
pub const CHUNK_BYTES: usize = 1 << 20;

/// Most bytes of a message: a chunk, or a page of jobs.
pub const MAX_MESSAGE_BYTES: usize = 4 << 20;
