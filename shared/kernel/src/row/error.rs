use crate::replica::ReplicaError;

/// Why a job is not a request for rows.
#[derive(Debug, thiserror::Error)]
pub enum RequestError {
    /// A digest or a coordinate is wrong.
    #[error(transparent)]
    Replica(#[from] ReplicaError),
    /// A part of the message is missing or out of range.
    #[error("invalid job: {0}")]
    Invalid(&'static str),
}
