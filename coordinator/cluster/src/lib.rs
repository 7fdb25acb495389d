//! The cluster: rows and tiles by workers, in this process or elsewhere.
//!
//! In: replicas and requests, through the bake's [`bake::RowService`]. Out: finished rows, the same bits on any workers and after any
//! failure. It must not know glTF, meshes or output files. Begin reading at [`scheduler`] (pure: events in, actions
//! out), then [`connections`] (its effects).
//!
//! | module | contents |
//! |---|---|
//! | [`scheduler`] | the job that goes next, and its worker |
//! | [`connections`] | [`Cluster`] and its handles, sessions, uploads |
//! | [`checkpoint`] | finished rows on disk, and a bake that resumes from them |
//! | [`metrics`] | metrics of the cluster, its workers and bakes, for Prometheus |
//! | `simulation` | coordinator and workers over a simulated network, in tests |

pub mod checkpoint;
pub mod connections;
pub mod metrics;
pub mod scheduler;
#[cfg(test)]
mod simulation;

pub use connections::*;
