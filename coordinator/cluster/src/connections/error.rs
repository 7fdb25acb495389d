use std::error::Error;

use kernel::replica::Digest;
use protocol::worker::VersionMismatch;
use tonic::Code;

use crate::scheduler::{Abandonment, JobId};

/// Why rows cannot be had.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ClusterError {
    /// No worker is configured.
    #[error("no workers: give at least one thread or one address")]
    NoWorkers,
    /// The network threads or the embedded worker did not start.
    #[error("cannot start the workers of this process: {0}")]
    Start(String),
    /// An address is not of the right form.
    #[error("{address:?} is not the address of a worker: write host:port")]
    Address {
        /// As it was given.
        address: String,
    },
    /// No worker answers.
    #[error(
        "no worker answers at {address}: {reason}; start one there with `worker --listen host:port`, or \
         correct the address"
    )]
    Unreachable {
        /// As it was given, with the machine's address.
        address: String,
        /// Error of the system.
        reason: String,
    },
    /// The worker is of another version.
    #[error("worker at {address} {mismatch}")]
    Version {
        /// The worker's address.
        address: String,
        /// Which version differs.
        mismatch: VersionMismatch,
    },
    /// The peer is not a worker, or refuses.
    #[error("worker at {address} refuses the session: {reason}")]
    Refused {
        /// The worker's address.
        address: String,
        /// The worker's words.
        reason: String,
    },
    /// The connection is not as secure as required: plain text beyond this machine, or a refused certificate.
    #[error("worker at {address} is not talked to: {reason}")]
    Insecure {
        /// The worker's address.
        address: String,
        /// Why, and the cure.
        reason: String,
    },
    /// All workers are lost, and none came back.
    #[error("all workers are lost: {}", reasons.join("; "))]
    AllWorkersLost {
        /// How each was lost, or why it was never reached.
        reasons: Vec<String>,
    },
    /// A job failed on every try.
    #[error("job {job} cannot be computed, {why}: {message}")]
    Abandoned {
        /// The job.
        job: JobId,
        /// Why it is not tried again.
        why: Abandonment,
        /// The last worker's words.
        message: String,
    },
    /// A job needs a replica that was not published, or was released.
    #[error("replica {0} is not published, and a job needs it")]
    NotPublished(Digest),
    /// The cluster's task has ended.
    #[error("the cluster has stopped")]
    Stopped,
}

impl ClusterError {
    /// Whether dialling the same process again cannot help.
    pub(super) fn is_final(&self) -> bool {
        matches!(
            self,
            Self::Version { .. } | Self::Refused { .. } | Self::Address { .. } | Self::Insecure { .. }
        )
    }
}

/// Whether the peer itself refused, rather than the network: then it does so again.
pub(super) fn is_refusal(status: &tonic::Status) -> bool {
    let says_no = matches!(
        status.code(),
        Code::FailedPrecondition
            | Code::InvalidArgument
            | Code::PermissionDenied
            | Code::ResourceExhausted
            | Code::Unauthenticated
            | Code::Unimplemented
    );
    says_no && status.source().is_none()
}

/// Whether the worker refused a replica for its size or its content, or failed to make it ready.
pub(super) fn is_refusal_of_replica(status: &tonic::Status) -> bool {
    let is_about_it =
        matches!(status.code(), Code::ResourceExhausted | Code::InvalidArgument | Code::Internal);
    is_about_it && status.source().is_none()
}

/// Innermost source of an error: the message of the system below those of the libraries.
pub(super) fn reason(error: &dyn Error) -> String {
    let mut innermost = error;
    while let Some(source) = innermost.source() {
        innermost = source;
    }
    innermost.to_string()
}

/// Message of a status: the worker's own, or why the connection failed.
pub(super) fn words(status: &tonic::Status) -> String {
    if status.source().is_some() { reason(status) } else { status.message().into() }
}
