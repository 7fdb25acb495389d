//! Asking for rows and getting them.

use std::collections::HashMap;

use shared::protocol::RowStatistics;
use shared::replica::{Digest, EncodedReplica, Receivers, encode_receivers};
use shared::row::{RowRequest, Sampling, Shooter};

use super::receivers::receivers;
use super::{BakeSettings, Phase, Progress};
use crate::cluster::{Cluster, FinishedJob, JobId};
use crate::mesh::{Mesh, VertexId};

/// A job should have about this many pairs of shooter and receiver: some milliseconds of work, so that the message costs
/// nothing beside it and the end of a batch does not wait for one worker.
const PAIRS_PER_JOB: usize = 8_000;

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
    sampling: Sampling,
    /// What the caller called each job under way.
    tags: HashMap<JobId, u64>,
    next_job: u64,
    /// What has been computed so far.
    pub statistics: RowStatistics,
    progress: Progress,
}

impl<'a> RowOffice<'a> {
    /// Opens the office for a scene.
    pub fn new(
        service: &'a mut dyn RowService,
        report: &'a mut dyn FnMut(&Progress),
        scene: EncodedReplica,
        settings: &BakeSettings,
    ) -> Self {
        let digest = scene.digest;
        service.publish(scene);
        Self {
            service,
            report,
            scene: digest,
            sampling: Sampling {
                rays_per_hemisphere: settings.rays_per_hemisphere,
                minimum_rays: settings.minimum_rays,
                maximum_rays: settings.maximum_rays,
                seed: settings.seed,
            },
            tags: HashMap::new(),
            next_job: 0,
            statistics: RowStatistics::default(),
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

    /// Publishes the vertices from `first` on.
    pub fn publish_receivers(&mut self, mesh: &Mesh, first: VertexId) -> ReceiverSet {
        self.publish(&receivers(mesh, first))
    }

    /// Publishes these receivers.
    pub fn publish(&mut self, receivers: &Receivers) -> ReceiverSet {
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
        let per_job = (PAIRS_PER_JOB / set.count.max(1)).max(1);
        self.expect_rows(shooters.len() as u64);
        for (index, some) in shooters.chunks(per_job).enumerate() {
            self.submit((index * per_job) as u64, some.to_vec(), set);
        }
        let mut rows = vec![vec![]; shooters.len()];
        while !self.tags.is_empty() {
            let (first, some) = self.next()?;
            for (place, row) in rows[first as usize..].iter_mut().zip(some) {
                *place = row;
            }
        }
        Ok(rows)
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
            sampling: self.sampling,
        };
        self.service.submit(vec![(job, request)]);
    }

    /// Waits for the next job, whatever its place: its tag and its rows.
    pub fn next(&mut self) -> Result<(u64, Vec<Vec<f32>>), BakeError> {
        loop {
            let finished = self.service.next()?;
            if let Some(tag) = self.tags.remove(&finished.job) {
                self.statistics.rays += finished.statistics.rays;
                self.statistics.factors += finished.statistics.factors;
                self.statistics.sampled_pairs += finished.statistics.sampled_pairs;
                self.statistics.busy_nanoseconds += finished.statistics.busy_nanoseconds;
                self.progress.rows += finished.rows.len() as u64;
                self.progress.rays = self.statistics.rays;
                (self.report)(&self.progress);
                return Ok((tag, finished.rows));
            }
        }
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
