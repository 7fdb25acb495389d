//! One job: checked against the replicas, then computed.

use std::sync::Arc;

use kernel::picture::TileError;
use kernel::replica::Digest;
use kernel::row::{
    Hemisphere, RequestError, Row, RowRequest, Shape, Shooter, encode_row, longest_encoded_row,
};
use kernel::visibility::{ReceiverGroups, Stop};
use protocol::worker::worker_message::Body;
use protocol::worker::{
    FailureReason, Finished, JobFailed, MAX_MESSAGE_BYTES, RowJob, RowStatistics, digest_of_rows,
};
use tokio::time::Instant;

use crate::engine::{ReceiverSet, Scene, compute_hemisphere, compute_rows_until};
use crate::pool::Panicked;
use crate::store::{Replica, ReplicaStore};

/// Rays that a job may take at most: pairs of a receiver and a polygon, times the rays that a pair may have. A bake's jobs have
/// some 10^10 of them in the worst case, and cast few; this bounds how long a caller can keep a thread busy.
const MOST_RAYS: u64 = 1 << 42;

/// A job that can be computed: it holds all that it needs.
pub struct Job {
    id: u64,
    request: RowRequest,
    scene: Arc<Scene>,
    receivers: Over,
}

/// What the rows of a job are over.
enum Over {
    /// Receivers.
    Receivers {
        /// All of the set.
        receivers: Arc<ReceiverSet>,
        /// Key of the first of the range.
        first_key: u64,
    },
    /// The polygons of the scene.
    Polygons,
}

/// Most bytes that a factor of a hemisphere takes in its row.
const BYTES_PER_RAY: u64 = 32;

/// Whether the rows are those of hemispheres: all are, or none.
fn is_of_hemispheres(request: &RowRequest) -> Result<bool, JobError> {
    let is_hemisphere = |shooter: &Shooter| matches!(shooter.shape, Shape::Hemisphere(_));
    let count = request.shooters.iter().filter(|shooter| is_hemisphere(shooter)).count();
    match count {
        0 => Ok(false),
        _ if count == request.shooters.len() && request.receivers == request.scene => Ok(true),
        _ => {
            Err(RequestError::Invalid("rows of hemispheres are over the scene's polygons, all of a job")
                .into())
        }
    }
}

fn out_of_range(request: &RowRequest, held: usize) -> JobError {
    let (first, count) = (request.first_receiver, request.receiver_count);
    JobError::Range { first, count, replica: request.receivers, held }
}

/// The range must lie within what is held; that of hemispheres is all of it.
fn check_range(request: &RowRequest, held: usize) -> Result<(), JobError> {
    let end = u64::from(request.first_receiver) + u64::from(request.receiver_count);
    let is_whole = request.first_receiver == 0 && end == held as u64;
    if end <= held as u64 && (is_whole || request.receivers != request.scene) {
        return Ok(());
    }
    Err(out_of_range(request, held))
}

/// Why a job is not computed.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// The message is not a request for rows.
    #[error(transparent)]
    Request(#[from] RequestError),
    /// The message is not a request for a tile.
    #[error(transparent)]
    Tile(#[from] TileError),
    /// A replica is not here, or not any more.
    #[error("replica {0} is not loaded")]
    UnknownReplica(Digest),
    /// A replica is here, but of the other kind.
    #[error("replica {0} is of the wrong kind")]
    WrongKind(Digest),
    /// The range goes beyond the receivers.
    #[error("receivers {first} to {first} + {count} do not exist, replica {replica} has {held}")]
    Range {
        /// First receiver of the range.
        first: u32,
        /// Number of receivers in the range.
        count: u32,
        /// The receiver replica.
        replica: Digest,
        /// Number of receivers in it.
        held: usize,
    },
    /// The rows would not fit into one message.
    #[error("rows of this job may take {bytes} bytes, and a message holds {MAX_MESSAGE_BYTES}: cut the job")]
    TooLarge {
        /// Largest length of the rows together.
        bytes: u64,
    },
    /// The rows would take a thread too long.
    #[error(
        "this job may take {rays} rays, and one may take {MOST_RAYS}: cut the job, or ask for fewer rays"
    )]
    TooLong {
        /// Largest number of rays.
        rays: u64,
    },
    /// The computation panicked.
    #[error(transparent)]
    Panicked(#[from] Panicked),
    /// The coordinator took it back before it was begun.
    #[error("the job was cancelled before it began")]
    Cancelled,
}

impl JobError {
    /// The same for the other side.
    #[must_use]
    pub fn to_message(&self, job_id: u64) -> JobFailed {
        let reason = match self {
            Self::UnknownReplica(_) => FailureReason::UnknownReplica,
            Self::Request(_)
            | Self::Tile(_)
            | Self::WrongKind(_)
            | Self::Range { .. }
            | Self::TooLarge { .. }
            | Self::TooLong { .. } => FailureReason::InvalidJob,
            Self::Panicked(_) => FailureReason::Internal,
            Self::Cancelled => FailureReason::Cancelled,
        };
        JobFailed { job_id, reason: reason.into(), message: self.to_string() }
    }
}

/// Rows with what they cost.
type Rows = Vec<(Row, RowStatistics)>;

impl Job {
    /// Reads a job and takes hold of its replicas.
    ///
    /// # Errors
    /// When the job is invalid or names a replica that the store does not hold.
    pub fn new(message: &RowJob, store: &mut ReplicaStore) -> Result<Self, JobError> {
        let request = RowRequest::from_job(message)?;
        let scene = match store.get(request.scene) {
            Some(Replica::Scene(scene)) => scene,
            Some(_) => return Err(JobError::WrongKind(request.scene)),
            None => return Err(JobError::UnknownReplica(request.scene)),
        };
        let receivers = if is_of_hemispheres(&request)? {
            // After the polygons comes the sky.
            check_range(&request, scene.polygons() + 1)?;
            Over::Polygons
        } else {
            let receivers = match store.get(request.receivers) {
                Some(Replica::Receivers(receivers)) => receivers,
                Some(_) => return Err(JobError::WrongKind(request.receivers)),
                None => return Err(JobError::UnknownReplica(request.receivers)),
            };
            check_range(&request, receivers.groups.receivers().len())?;
            // The keys of the range must exist too, whatever the replica claims as its first.
            let first_key = receivers
                .first_key
                .checked_add(u64::from(request.first_receiver))
                .filter(|key| key.checked_add(u64::from(request.receiver_count)).is_some())
                .ok_or_else(|| out_of_range(&request, receivers.groups.receivers().len()))?;
            Over::Receivers { receivers, first_key }
        };
        let rays_of = |shooter: &Shooter| match &shooter.shape {
            Shape::Hemisphere(hemisphere) => hemisphere.rays,
            _ => 0,
        };
        let most_rays = request.shooters.iter().map(rays_of).max().unwrap_or(0);
        // Some bytes for the fields around each row.
        let row = match &receivers {
            Over::Receivers { .. } => longest_encoded_row(request.receiver_count) + 32,
            // Each of the rays ends at a polygon or in the sky, in a group of its own.
            Over::Polygons => {
                longest_encoded_row(request.receiver_count)
                    .min(u64::from(Hemisphere::MOST_RAYS.min(most_rays)) * BYTES_PER_RAY)
                    + 32
            }
        };
        let bytes = row.saturating_mul(request.shooters.len() as u64);
        if bytes > MAX_MESSAGE_BYTES as u64 - 1024 {
            return Err(JobError::TooLarge { bytes });
        }
        let most_rays_of = |shooter: &Shooter| match &shooter.shape {
            Shape::Hemisphere(_) => u64::from(most_rays),
            Shape::Sky(rays) => u64::from(*rays),
            shape => (shape.polygons() as u64).saturating_mul(request.precision.maximum_rays.into()),
        };
        let rays = request.shooters.iter().map(most_rays_of).fold(0, u64::saturating_add);
        let rays = match &receivers {
            Over::Receivers { .. } => rays.saturating_mul(request.receiver_count.into()),
            Over::Polygons => rays,
        };
        if rays > MOST_RAYS {
            return Err(JobError::TooLong { rays });
        }
        Ok(Self { id: message.job_id, request, scene, receivers })
    }

    /// What it asks for.
    #[must_use]
    pub fn request(&self) -> &RowRequest {
        &self.request
    }

    /// Computes the rows, on the calling thread.
    #[must_use]
    pub fn compute(&self) -> Finished {
        // It ends only where it is told to stop.
        self.compute_until(&|| false).unwrap_or_default()
    }

    /// The same, asking `stop` every few milliseconds; nothing where it says so.
    #[must_use]
    #[tracing::instrument(name = "job", skip_all, fields(
        job = self.id,
        rows = self.request.shooters.len(),
        receivers = self.request.receiver_count,
    ))]
    pub fn compute_until(&self, stop: Stop) -> Option<Finished> {
        let part;
        let compute: &dyn Fn(&[Shooter]) -> Option<Rows> = match &self.receivers {
            Over::Receivers { receivers, first_key } => {
                let all = receivers.groups.receivers();
                let first = self.request.first_receiver as usize;
                let range = first..first + self.request.receiver_count as usize;
                let groups = if range == (0..all.len()) {
                    &receivers.groups
                } else {
                    part = ReceiverGroups::new(all[range].to_vec());
                    &part
                };
                &move |shooters| {
                    let precision = &self.request.precision;
                    let rows =
                        compute_rows_until(&self.scene, groups, *first_key, shooters, precision, stop)?;
                    Some(rows.iter().map(|(row, statistics)| (Row::new(row), *statistics)).collect())
                }
            }
            Over::Polygons => &|shooters| {
                let row = |shooter: &Shooter| match &shooter.shape {
                    // Of some thousand rays.
                    Shape::Hemisphere(_) if stop() => None,
                    Shape::Hemisphere(hemisphere) => {
                        let precision = &self.request.precision;
                        Some(compute_hemisphere(&self.scene, hemisphere, shooter.key, precision))
                    }
                    // Checked when the job was read.
                    _ => Some((Row::of_some(self.scene.polygons() + 1, &[]), RowStatistics::default())),
                };
                shooters.iter().map(row).collect()
            },
        };
        let (mut rows, mut statistics) = (vec![], vec![]);
        for shooters in self.request.shooters.chunk_by(|before, own| own.is_next_channel_of(before)) {
            let mut start = Instant::now();
            for (row, own) in compute(shooters)? {
                rows.push(encode_row(&row));
                let busy_nanoseconds = start.elapsed().as_nanos().try_into().unwrap_or(u64::MAX);
                statistics.push(RowStatistics { busy_nanoseconds, ..own });
                start = Instant::now();
            }
        }
        let digest = digest_of_rows(&rows).to_bytes();
        Some(Finished { job_id: self.id, rows, statistics, digest })
    }
}

/// The answer to a job.
#[must_use]
pub fn answer(job_id: u64, result: Result<Body, JobError>) -> Body {
    match result {
        Ok(answer) => answer,
        Err(error) => Body::Failed(error.to_message(job_id)),
    }
}

#[cfg(test)]
mod tests;
