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
            check_range(&request, scene.polygons())?;
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
            // Each of the rays meets a polygon at most, in a group of its own.
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
        let compute: &dyn Fn(&[Shooter]) -> Option<Vec<(Row, RowStatistics)>> = match &self.receivers {
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
                    _ => Some((Row::of_some(self.scene.polygons(), &[]), RowStatistics::default())),
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
mod tests {
    use glam::DVec3;
    use kernel::geometry::{ConvexPolygon, PlaneId};
    use kernel::messages;
    use kernel::replica::{EncodedReplica, Receiver, Receivers, encode_receivers, encode_scene};
    use kernel::row::{Precision, Shape, Shooter, decode_row};

    use super::*;

    /// A store that holds an empty scene and three receivers, and a job that both can answer.
    fn prepared() -> (ReplicaStore, RowRequest) {
        let receiver = |x| Receiver { position: DVec3::X * x, normal: DVec3::Y, plane: PlaneId(0) };
        let set = Receivers { first_key: 5, receivers: [0.0, 1.0, 2.0].map(receiver).to_vec() };
        let (scene, receivers) = (encode_scene(&[]), encode_receivers(&set));
        let mut store = ReplicaStore::new(1 << 20);
        for EncodedReplica { digest, kind, bytes } in [&scene, &receivers] {
            store.insert(*digest, Replica::decode(*kind, bytes).unwrap(), bytes.len() as u64);
        }
        let request = RowRequest {
            scene: scene.digest,
            receivers: receivers.digest,
            first_receiver: 1,
            receiver_count: 2,
            shooters: vec![Shooter { key: 1, shape: Shape::Point(DVec3::new(1.0, 2.0, 0.0)) }],
            precision: Precision {
                rays_per_hemisphere: 64,
                minimum_rays: 1,
                maximum_rays: 64,
                seed: 1,
                factor_rounding: 0.0,
                ..Precision::DEFAULT
            },
        };
        (store, request)
    }

    fn reason(request: &RowRequest, store: &mut ReplicaStore) -> FailureReason {
        Job::new(&request.to_job(9), store).err().unwrap().to_message(9).reason()
    }

    #[test]
    fn a_range_of_the_receivers_is_computed() {
        let (mut store, request) = prepared();
        let finished = Job::new(&request.to_job(9), &mut store).unwrap().compute();
        assert_eq!((finished.job_id, finished.rows.len()), (9, 1));
        let row = decode_row(&finished.rows[0], 2).unwrap();
        // A light 2 above the first receiver of the range, and sqrt(5) from the second: cos / r^2.
        assert_eq!(row.to_dense(), [0.25, (2.0 / 5.0_f64.powf(1.5)) as f32]);
    }

    /// Its polygons travel once, and the work on all channels counts once.
    #[test]
    fn channels_of_one_shape_have_the_same_rows_together_and_alone() {
        let (mut store, request) = prepared();
        let tile = |step: u32| {
            let corner = |[x, z]: [f64; 2]| DVec3::new(f64::from(step) + x, 3.0, z);
            let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(corner).to_vec();
            ConvexPolygon { plane: PlaneId(1), corners }
        };
        let weights =
            |step: u32| [step, 8 - step, u32::from(step == 3)].map(|eighth| f64::from(eighth) / 8.0);
        let shapes = Shape::of_colours((0..8).map(|step| (tile(step), weights(step))).collect());
        let shooters: Vec<Shooter> = (40..).zip(shapes).map(|(key, shape)| Shooter { key, shape }).collect();
        let polygons = |shooter: &messages::Shooter| match &shooter.shape {
            Some(messages::shooter::Shape::Weighted(set)) => set.polygons.len(),
            _ => 0,
        };
        let mut compute = |shooters: &[Shooter]| {
            let message = RowRequest { shooters: shooters.to_vec(), ..request.clone() }.to_job(9);
            (
                Job::new(&message, &mut store).unwrap().compute(),
                message.shooters.iter().map(polygons).sum::<usize>(),
            )
        };
        let (together, sent) = compute(&shooters);
        let alone: Vec<_> = shooters.chunks(1).map(&mut compute).collect();
        for (at, (own, own_sent)) in alone.iter().enumerate() {
            assert_eq!(own.rows, [together.rows[at].clone()], "{at}");
            assert_eq!((sent, *own_sent), (8, 8));
            let counts = |statistics: &RowStatistics| {
                (statistics.pairs, statistics.rays, statistics.sampling_variance.to_bits())
            };
            assert_eq!(counts(&own.statistics[0]), counts(&together.statistics[at]));
            assert_eq!(own.statistics[0].pairs, if at == 0 { 16 } else { 0 });
        }
    }

    #[test]
    fn a_missing_replica_can_be_loaded_and_a_senseless_job_not() {
        let (mut store, request) = prepared();
        let other = Digest::of(b"other");
        let unknown = RowRequest { receivers: other, ..request.clone() };
        assert_eq!(reason(&unknown, &mut store), FailureReason::UnknownReplica);
        let swapped = RowRequest { receivers: request.scene, ..request.clone() };
        assert_eq!(reason(&swapped, &mut store), FailureReason::InvalidJob);
        let beyond = RowRequest { first_receiver: u32::MAX, ..request.clone() };
        assert_eq!(reason(&beyond, &mut store), FailureReason::InvalidJob);
        let endless = RowRequest { shooters: vec![request.shooters[0].clone(); 4 << 20], ..request };
        assert_eq!(reason(&endless, &mut store), FailureReason::InvalidJob);
    }

    #[tokio::test]
    async fn a_panic_is_a_failure_that_another_worker_may_not_have() {
        let pool = crate::pool::ComputePool::new(1).unwrap();
        let result = pool.run(|| panic!("broken")).await.map_err(JobError::from);
        let Body::Failed(failed) = answer(9, result) else { panic!("not a failure") };
        assert_eq!((failed.job_id, failed.reason()), (9, FailureReason::Internal));
    }
}
