//! The messages of `proto/radiosity/worker/v1`, generated at build time. The services are generated where the network is known.

#![allow(missing_docs, clippy::all)]

include!(concat!(env!("OUT_DIR"), "/radiosity.worker.v1.rs"));
