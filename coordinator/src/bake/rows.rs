//! Asking for rows and getting them.

use std::collections::HashMap;

use shared::protocol::RowStatistics;
use shared::replica::{Digest, EncodedReplica, Receivers, encode_receivers};
use shared::row::{Precision, RowRequest, Shooter};

use super::{Phase, Progress};
use crate::cluster::{Cluster, FinishedJob, JobId};

/// A job should have about this many pairs of shooter and receiver: some milliseconds of work, so that the message costs
/// nothing beside it and the end of a batch does not wait for one worker.
const PAIRS_PER_JOB: usize = 8_000;

/// Form factors are summed up in this unit: 2^-50, far below the rounding of a row.
const SUM_UNIT: f64 = 1.0 / (1_u64 << 50) as f64;

/// Whoever computes rows: a cluster of workers, in this process or elsewhere.
pub trait RowService {
    /// Makes a replica known before the first job that needs it.
    fn publish(&mut self, replica: EncodedReplica);
    /// Says that a replica will not be used again.
    fn release(&mut self, digest: Digest);
    /// Asks for rows; earlier requests are more urgent.
    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>);
    /// Waits for the next finished job, in any order.
    ///
    /// # Errors
    /// When no more rows can be had.
    fn next(&mut self) -> Result<FinishedJob, BakeError>;
}

impl RowService for Cluster {
    fn publish(&mut self, replica: EncodedReplica) {
        Cluster::publish(self, replica);
    }

    fn release(&mut self, digest: Digest) {
        Cluster::release(self, digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        Cluster::submit(self, requests);
    }

    fn next(&mut self) -> Result<FinishedJob, BakeError> {
        Cluster::next(self).map_err(|error| BakeError::Rows(Box::new(error)))
    }
}

/// Why a bake failed.
#[derive(Debug, thiserror::Error)]
pub enum BakeError {
    /// Nothing is left of the scene after welding.
    #[error("the scene has no surface large enough to hold a patch")]
    EmptyMesh,
    /// The rows would not fit in memory.
    #[error(
        "rows between {vertices} vertices take more than {mebibytes} MiB: simplify the scene's geometry, or raise --row-memory"
    )]
    TooManyVertices {
        /// Vertices of the mesh before refinement.
        vertices: usize,
        /// What the settings allow.
        mebibytes: usize,
    },
    /// The arithmetic went wrong: better no output than a black one.
    #[error("the solution is not finite: please report the scene as a fault of this program")]
    NotFinite,
    /// No more rows.
    #[error("rows cannot be computed: {0}")]
    Rows(#[source] Box<dyn std::error::Error + Send + Sync>),
}

/// A published set of receivers.
#[derive(Debug, Clone, Copy)]
pub struct ReceiverSet {
    digest: Digest,
    count: usize,
}

/// Cuts wishes into jobs, keeps account of them and of what they cost.
pub struct RowOffice<'a> {
    service: &'a mut dyn RowService,
    report: &'a mut dyn FnMut(&Progress),
    scene: Digest,
    precision: Precision,
    /// What the caller called each job under way.
    tags: HashMap<JobId, u64>,
    next_job: u64,
    /// Counts of what has been computed so far.
    pub statistics: RowStatistics,
    /// Sums of all form factors and of their errors, in units of [`SUM_UNIT`]: jobs finish in any order, and only sums of whole
    /// numbers are the same in all.
    factor_sums: [u128; 2],
    progress: Progress,
}

impl<'a> RowOffice<'a> {
    /// Opens the office for a scene.
    pub fn new(
        service: &'a mut dyn RowService,
        report: &'a mut dyn FnMut(&Progress),
        scene: EncodedReplica,
    ) -> Self {
        let digest = scene.digest;
        service.publish(scene);
        Self {
            service,
            report,
            scene: digest,
            precision: Precision::DEFAULT,
            tags: HashMap::new(),
            next_job: 0,
            statistics: RowStatistics::default(),
            factor_sums: [0; 2],
            progress: Progress {
                phase: Phase::Light,
                unshot: 1.0,
                rows: 0,
                rows_needed: 0,
                rays: 0,
                vertices: 0,
            },
        }
    }

    /// Rows from now on are made like this.
    pub fn set_precision(&mut self, precision: Precision) {
        self.precision = precision;
    }

    /// Publishes a set of receivers.
    pub fn publish_receivers(&mut self, receivers: &Receivers) -> ReceiverSet {
        let replica = encode_receivers(receivers);
        let set = ReceiverSet { digest: replica.digest, count: receivers.receivers.len() };
        self.service.publish(replica);
        set
    }

    /// Lets the workers forget a set of receivers.
    pub fn release_receivers(&mut self, set: ReceiverSet) {
        self.service.release(set.digest);
    }

    /// Rows of these shooters over all receivers of a set.
    pub fn rows(&mut self, shooters: &[Shooter], set: ReceiverSet) -> Result<Vec<Vec<f32>>, BakeError> {
        self.rows_with_variances(shooters, set).map(|(rows, _)| rows)
    }

    /// Rows of these shooters over all receivers of a set, and the variance that sampling gave each row, summed over it.
    pub fn rows_with_variances(
        &mut self,
        shooters: &[Shooter],
        set: ReceiverSet,
    ) -> Result<(Vec<Vec<f32>>, Vec<f64>), BakeError> {
        let per_job = (PAIRS_PER_JOB / set.count.max(1)).max(1);
        self.expect_rows(shooters.len() as u64);
        for (index, some) in shooters.chunks(per_job).enumerate() {
            self.submit((index * per_job) as u64, some.to_vec(), set);
        }
        let mut rows = vec![vec![]; shooters.len()];
        let mut variances = vec![0.0; shooters.len()];
        while !self.tags.is_empty() {
            let (first, some) = self.next()?;
            for (i, (row, statistics)) in some.rows.into_iter().zip(some.statistics).enumerate() {
                rows[first as usize + i] = row;
                variances[first as usize + i] = statistics.sampling_variance;
            }
        }
        Ok((rows, variances))
    }

    /// Asks for one job, to be known by `tag`.
    pub fn submit(&mut self, tag: u64, shooters: Vec<Shooter>, set: ReceiverSet) {
        let job = JobId(self.next_job);
        self.next_job += 1;
        self.tags.insert(job, tag);
        let request = RowRequest {
            scene: self.scene,
            receivers: set.digest,
            first_receiver: 0,
            receiver_count: set.count as u32,
            shooters,
            precision: self.precision,
        };
        self.service.submit(vec![(job, request)]);
    }

    /// Waits for the next job, whatever its place: its tag and its rows.
    pub fn next(&mut self) -> Result<(u64, FinishedJob), BakeError> {
        loop {
            let finished = self.service.next()?;
            if let Some(tag) = self.tags.remove(&finished.job) {
                for row in &finished.statistics {
                    add(&mut self.statistics, row);
                    for (sum, part) in self.factor_sums.iter_mut().zip([row.factor_sum, row.factor_error_sum])
                    {
                        *sum += (part / SUM_UNIT) as u128;
                    }
                }
                self.progress.rows += finished.rows.len() as u64;
                self.progress.rays = self.statistics.rays;
                (self.report)(&self.progress);
                return Ok((tag, finished));
            }
        }
    }

    /// Mean relative error that the rules for form factors have.
    pub fn factor_error(&self) -> f64 {
        let [factors, errors] = self.factor_sums.map(|sum| sum as f64);
        if factors > 0.0 { errors / factors } else { 0.0 }
    }

    /// Number of rows made.
    pub fn rows_made(&self) -> u64 {
        self.progress.rows
    }

    /// So many more rows will be needed.
    pub fn expect_rows(&mut self, rows: u64) {
        self.progress.rows_needed = (self.progress.rows + rows).max(self.progress.rows_needed);
    }

    /// A step begins.
    pub fn enter(&mut self, phase: Phase, vertices: usize) {
        self.progress.phase = phase;
        self.progress.vertices = vertices;
        (self.report)(&self.progress);
    }

    /// The unshot flux, relative to the reflected.
    pub fn set_unshot(&mut self, unshot: f64) {
        self.progress.unshot = unshot;
    }
}

/// Adds the counts.
fn add(sum: &mut RowStatistics, row: &RowStatistics) {
    sum.rays += row.rays;
    sum.pairs += row.pairs;
    sum.factors += row.factors;
    sum.occluded_pairs += row.occluded_pairs;
    sum.sampled_pairs += row.sampled_pairs;
    sum.busy_nanoseconds += row.busy_nanoseconds;
}
