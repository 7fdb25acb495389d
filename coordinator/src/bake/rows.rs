//! Asking for rows and getting them.

use std::collections::{BTreeMap, HashMap, VecDeque};

use shared::protocol::RowStatistics;
use shared::replica::{Digest, EncodedReplica, Receivers, encode_receivers};
use shared::row::{Precision, Row, RowRequest, Shooter};

use super::{Phase, Progress};
use crate::cluster::{Cluster, FinishedJob, JobId};

/// A job should have about this many pairs of shooter and receiver: some milliseconds of work, so that the message costs
/// nothing beside it and the end of a batch does not wait for one worker.
const PAIRS_PER_JOB: usize = 16_000;

/// So many jobs are under way at most where rows are asked for in bulk: enough to keep a hundred threads busy, few enough that
/// rows which wait for their turn take little memory.
const MOST_UNDER_WAY: usize = 256;

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

impl ReceiverSet {
    /// Number of receivers.
    pub fn count(&self) -> usize {
        self.count
    }

    /// How many shooters a job over all of them should have.
    pub fn shooters_per_job(&self) -> usize {
        (PAIRS_PER_JOB / self.count.max(1)).max(1)
    }
}

/// What one job is to compute.
pub struct Wish {
    /// One row each.
    pub shooters: Vec<Shooter>,
    /// Over all receivers of a set.
    pub set: ReceiverSet,
    /// Which of these rows were made before: they do not count as what the scene needs.
    pub again: Vec<bool>,
}

/// Cuts wishes into jobs, keeps account of them and of what they cost.
pub struct RowOffice<'a> {
    service: &'a mut dyn RowService,
    report: &'a mut dyn FnMut(&Progress),
    scene: Digest,
    precision: Precision,
    /// What the caller called each job under way, and which of its rows were made before.
    tags: HashMap<JobId, (u64, Vec<bool>)>,
    next_job: u64,
    /// Counts of what has been computed so far.
    pub statistics: RowStatistics,
    /// Sums of all form factors and of their errors, in units of [`SUM_UNIT`]: jobs finish in any order, and only sums of whole
    /// numbers are the same in all.
    factor_sums: [u128; 2],
    rows_again: u64,
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
            rows_again: 0,
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

    /// Makes the rows of these shooters over all receivers of a set, and hands them over in their order, each with its index and
    /// the variance that sampling gave it, summed over it.
    pub fn each_row(
        &mut self,
        shooters: &[Shooter],
        set: ReceiverSet,
        mut take: impl FnMut(usize, &Row, f64),
    ) -> Result<(), BakeError> {
        self.expect_rows(shooters.len() as u64);
        let mut next = 0;
        let wish = |some: &[Shooter]| Wish { shooters: some.to_vec(), set, again: vec![false; some.len()] };
        let wishes = shooters.chunks(set.shooters_per_job()).map(|some| ((), wish(some)));
        self.in_order(wishes, |(), finished| {
            for (row, statistics) in finished.rows.iter().zip(&finished.statistics) {
                take(next, row, statistics.sampling_variance);
                next += 1;
            }
        })
    }

    /// Has all wishes computed, a bounded number of them at a time, and hands over the answers in the order of the wishes, each
    /// with what was given beside its wish. No other job may be under way.
    pub fn in_order<T>(
        &mut self,
        mut wishes: impl Iterator<Item = (T, Wish)>,
        mut take: impl FnMut(T, FinishedJob),
    ) -> Result<(), BakeError> {
        let mut under_way = VecDeque::new();
        let mut arrived: BTreeMap<u64, FinishedJob> = BTreeMap::new();
        let (mut submitted, mut taken) = (0, 0);
        loop {
            while under_way.len() < MOST_UNDER_WAY
                && let Some((beside, wish)) = wishes.next()
            {
                under_way.push_back(beside);
                self.submit(submitted, wish);
                submitted += 1;
            }
            if under_way.is_empty() {
                return Ok(());
            }
            let (number, finished) = self.next()?;
            arrived.insert(number, finished);
            while let Some(finished) = arrived.remove(&taken)
                && let Some(beside) = under_way.pop_front()
            {
                take(beside, finished);
                taken += 1;
            }
        }
    }

    /// Asks for one job, to be known by `tag`.
    pub fn submit(&mut self, tag: u64, wish: Wish) {
        let job = JobId(self.next_job);
        self.next_job += 1;
        self.tags.insert(job, (tag, wish.again));
        let request = RowRequest {
            scene: self.scene,
            receivers: wish.set.digest,
            first_receiver: 0,
            receiver_count: wish.set.count as u32,
            shooters: wish.shooters,
            precision: self.precision,
        };
        self.service.submit(vec![(job, request)]);
    }

    /// Waits for the next job, whatever its place: its tag and its rows.
    pub fn next(&mut self) -> Result<(u64, FinishedJob), BakeError> {
        loop {
            let finished = self.service.next()?;
            if let Some((tag, again)) = self.tags.remove(&finished.job) {
                for (row, again) in finished.statistics.iter().zip(again) {
                    self.count(row, again);
                }
                (self.report)(&self.progress);
                return Ok((tag, finished));
            }
        }
    }

    fn count(&mut self, row: &RowStatistics, again: bool) {
        self.progress.rows += 1;
        self.progress.rays += row.rays;
        self.statistics.busy_nanoseconds += row.busy_nanoseconds;
        if again {
            self.rows_again += 1;
            return;
        }
        self.statistics.rays += row.rays;
        self.statistics.pairs += row.pairs;
        self.statistics.factors += row.factors;
        self.statistics.occluded_pairs += row.occluded_pairs;
        self.statistics.sampled_pairs += row.sampled_pairs;
        for (sum, part) in self.factor_sums.iter_mut().zip([row.factor_sum, row.factor_error_sum]) {
            *sum += (part / SUM_UNIT) as u128;
        }
    }

    /// Mean relative error that the rules for form factors have.
    pub fn factor_error(&self) -> f64 {
        let [factors, errors] = self.factor_sums.map(|sum| sum as f64);
        if factors > 0.0 { errors / factors } else { 0.0 }
    }

    /// Number of different rows made.
    pub fn rows_made(&self) -> u64 {
        self.progress.rows - self.rows_again
    }

    /// Number of times that a row was made again, because it was not kept.
    pub fn rows_made_again(&self) -> u64 {
        self.rows_again
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
