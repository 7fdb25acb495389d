//! The protocols, and the security, logs and metrics of every program that speaks one.
//!
//! In: connections and settings. Out: generated messages and services, guarded transports, telemetry. It must not know how a row is
//! computed or which job goes next. Begin reading at [`worker`], the protocol between coordinator and workers.
//!
//! | module | contents |
//! |---|---|
//! | [`worker`] | the generated messages and services of `radiosity.worker.v1` |
//! | [`api`] | the generated messages and services of `radiosity.v1`, for clients of the service |
//! | [`network`] | names and connections: sockets, or a simulation |
//! | [`packing`] | replicas compressed for their way |
//! | [`replicas`] | a replica in pieces, on its way to a worker |
//! | [`security`] | certificates, tokens, limits of plain text |
//! | [`server`] | what servers have in common: limits of connections, and shutdown |
//! | [`telemetry`] | logs, metrics and spans |

pub mod api;
pub mod network;
pub mod packing;
pub mod replicas;
pub mod security;
pub mod server;
pub mod telemetry;
pub mod worker;
