use crate::replica::ReplicaError;

/// Why a job is not a request for rows.
#[derive(Debug, thiserror::Error)]
pub enum RequestError {
    /// A digest or a coordinate is wrong.
    #[error(transparent)]
    Replica(#[from] ReplicaError),
    /// A part of the message is missing or out of range.
    #[error("job makes no sense: {0}")]
    Invalid(&'static str),
}
