//! Requests to a worker.

use kernel::picture::TileRequest;
use kernel::replica::Digest;
use kernel::row::RowRequest;
use protocol::worker::coordinator_message::Body;

use crate::scheduler::JobId;

/// Content of a job.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Request {
    /// Rows of form factors.
    Rows(RowRequest),
    /// A tile of a picture.
    Tile(TileRequest),
}

impl Request {
    /// Replicas that it needs.
    pub(super) fn needs(&self) -> Vec<Digest> {
        match self {
            Self::Rows(rows) => vec![rows.scene, rows.receivers],
            Self::Tile(tile) => vec![tile.picture],
        }
    }

    /// Encodes the job as a message.
    pub(super) fn to_body(&self, job: JobId) -> Body {
        match self {
            Self::Rows(rows) => Body::Job(rows.to_job(job.0)),
            Self::Tile(tile) => Body::Tile(tile.to_job(job.0)),
        }
    }
}
