//! Asking for rows and getting them.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use kernel::geometry::ConvexPolygon;
use kernel::messages::RowStatistics;
use kernel::replica::{Digest, EncodedReplica, Receivers, encode_receivers, encode_translucent_scene};
use kernel::row::{FinishedJob, JobId, Precision, Row, RowRequest, Shooter};

use super::{Observer, Phase, Progress};
use crate::lit::LitMesh;

/// A job should have this many pairs of shooter and receiver at least: some milliseconds of work, so that the end of a batch does
/// not wait for one worker, and the message costs little beside it.
const LEAST_PAIRS: usize = 16_000;

/// And no more than this: a message of a megabyte or two.
const MOST_PAIRS: usize = 512_000;

/// In between a job should take so long: then its message costs next to nothing.
const JOB_NANOSECONDS: f64 = 25e6;

/// What is left of a batch makes so many jobs for each thread: they become smaller towards its end.
const JOBS_PER_THREAD: usize = 8;

/// So many jobs are under way at most where rows are asked for in bulk: enough to keep a hundred threads busy, few enough that
/// rows which wait for their turn take little memory.
const MOST_UNDER_WAY: usize = 256;

/// A ray of a hemisphere counts as so many pairs.
const PAIRS_PER_RAY: usize = 4;

/// Rows are waited for so long before the observer is asked again whether they are still wanted.
const PATIENCE: Duration = Duration::from_millis(100);

/// Form factors are summed up in this unit: 2^-50, far below the rounding of a row.
const SUM_UNIT: f64 = 1.0 / (1_u64 << 50) as f64;

/// Offices opened by this process. No job of one may be taken for one of another that has the same workers: what was withdrawn from
/// them may be answered late.
static OFFICES: AtomicU64 = AtomicU64::new(0);

/// More jobs than an office ever asks for.
const JOBS_OF_OFFICE: u64 = 1 << 40;

/// Whoever computes rows: a cluster of workers, in this process or elsewhere.
pub trait RowService {
    /// Makes a replica known before the first job that needs it.
    fn publish(&mut self, replica: EncodedReplica);
    /// Says that a replica will not be used again.
    fn release(&mut self, digest: Digest);
    /// Asks for rows; earlier requests are more urgent. No job id may be used twice.
    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>);
    /// Forgets all jobs that have no answer yet: none of them is answered any more.
    fn withdraw(&mut self);
    /// How many jobs are computed at the same time now.
    fn threads(&self) -> usize {
        1
    }
    /// Waits for the next finished job, in any order; `None` where there is none after about so long.
    ///
    /// # Errors
    /// When no more rows can be had.
    fn next(&mut self, patience: Duration) -> Result<Option<FinishedJob>, BakeError>;
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
    /// A group of lights that the scene does not have.
    #[error("group {group}: the scene has no light {light}; its lights are: {known}")]
    UnknownLight {
        /// The group.
        group: String,
        /// The name that is no light's.
        light: String,
        /// Those that are.
        known: String,
    },
    /// Whoever watches it wants it no more.
    #[error("the bake was cancelled")]
    Cancelled,
    /// No more rows.
    #[error("rows cannot be computed: {0}")]
    Rows(#[source] Box<dyn std::error::Error + Send + Sync>),
}

/// A published set that rows are over: of receivers, or of polygons that receivers see.
#[derive(Debug, Clone, Copy)]
pub struct ReceiverSet {
    digest: Digest,
    count: usize,
    /// What a row costs, in pairs of a shooter and a receiver.
    pairs: usize,
    /// It is a scene of its own: its polygons are what rows are over.
    is_scene: bool,
}

impl ReceiverSet {
    /// Number of receivers.
    pub fn count(&self) -> usize {
        self.count
    }

    /// How many shooters make so many pairs with them, or one.
    fn shooters(&self, pairs: usize) -> usize {
        (pairs / self.pairs.max(1)).max(1)
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

/// A job under way.
struct Asked {
    /// What the caller calls it.
    tag: u64,
    /// Which of its rows were made before.
    again: Vec<bool>,
    pairs: usize,
}

/// Cuts wishes into jobs, keeps account of them and of what they cost.
pub struct RowOffice<'a> {
    service: &'a mut dyn RowService,
    observer: &'a mut dyn Observer,
    scene: Digest,
    /// Replicas that are published, and for how many sets: two may have the same content.
    published: HashMap<Digest, usize>,
    precision: Precision,
    jobs: HashMap<JobId, Asked>,
    /// Pairs of the jobs that finished, and how long they took.
    pace: (f64, f64),
    next_job: u64,
    /// Counts of what has been computed so far.
    pub statistics: RowStatistics,
    /// Sums of all form factors and of their errors, in units of [`SUM_UNIT`]: jobs finish in any order, and only sums of whole
    /// numbers are the same in all.
    factor_sums: [u128; 2],
    rows_again: u64,
    visible_factors: u64,
    progress: Progress,
}

impl<'a> RowOffice<'a> {
    /// Opens the office for a scene.
    pub fn new(
        service: &'a mut dyn RowService,
        observer: &'a mut dyn Observer,
        scene: EncodedReplica,
    ) -> Self {
        let digest = scene.digest;
        service.publish(scene);
        Self {
            service,
            observer,
            scene: digest,
            published: HashMap::from([(digest, 1)]),
            precision: Precision::DEFAULT,
            jobs: HashMap::new(),
            pace: (0.0, 0.0),
            next_job: OFFICES.fetch_add(1, Ordering::Relaxed) * JOBS_OF_OFFICE,
            statistics: RowStatistics::default(),
            factor_sums: [0; 2],
            rows_again: 0,
            visible_factors: 0,
            progress: Progress {
                phase: Phase::Light,
                unshot: 1.0,
                error: None,
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

    /// Rays of a whole hemisphere.
    pub fn rays_per_hemisphere(&self) -> u32 {
        self.precision.rays_per_hemisphere
    }

    /// Publishes a set of receivers.
    pub fn publish_receivers(&mut self, receivers: &Receivers) -> ReceiverSet {
        let replica = encode_receivers(receivers);
        let count = receivers.receivers.len();
        let set = ReceiverSet { digest: replica.digest, count, pairs: count, is_scene: false };
        self.publish(replica);
        set
    }

    /// Publishes polygons that rows of hemispheres are over, with the opacity of each, or none where all are opaque.
    pub fn publish_polygons(&mut self, polygons: &[ConvexPolygon], opacities: &[f32]) -> ReceiverSet {
        let replica = encode_translucent_scene(polygons, opacities);
        // A ray through the scene takes about as long as some pairs with little between.
        let pairs = PAIRS_PER_RAY * self.precision.rays_per_hemisphere as usize;
        let set = ReceiverSet { digest: replica.digest, count: polygons.len(), pairs, is_scene: true };
        self.publish(replica);
        set
    }

    fn publish(&mut self, replica: EncodedReplica) {
        let sets = self.published.entry(replica.digest).or_default();
        *sets += 1;
        if *sets == 1 {
            self.service.publish(replica);
        }
    }

    /// Lets the workers forget a set of receivers.
    pub fn release_receivers(&mut self, set: ReceiverSet) {
        if let Some(sets) = self.published.get_mut(&set.digest) {
            *sets -= 1;
            if *sets == 0 {
                self.published.remove(&set.digest);
                self.service.release(set.digest);
            }
        }
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
        let (mut asked, mut next) = (0, 0);
        let wishes = |office: &Self| {
            let count = office.shooters_of_next_job(set, shooters.len() - asked);
            let some = &shooters[asked..asked + count];
            asked += count;
            let wish = Wish { shooters: some.to_vec(), set, again: vec![false; count] };
            (count > 0).then_some(((), wish))
        };
        self.in_order(wishes, |(), finished| {
            for (row, statistics) in finished.rows.iter().zip(&finished.statistics) {
                take(next, row, statistics.sampling_variance);
                next += 1;
            }
        })
    }

    /// How many shooters the next job of a batch over a set should have, where so many are left: few messages to begin with, and to
    /// end with jobs so small that all threads are done at the same time.
    pub fn shooters_of_next_job(&self, set: ReceiverSet, left: usize) -> usize {
        let each = left / (JOBS_PER_THREAD * self.threads());
        each.clamp(set.shooters(LEAST_PAIRS), self.most_shooters(set)).min(left)
    }

    /// How many shooters a job over a set should have at most.
    pub fn most_shooters(&self, set: ReceiverSet) -> usize {
        let (pairs, nanoseconds) = self.pace;
        let in_time = if nanoseconds > 0.0 { pairs * JOB_NANOSECONDS / nanoseconds } else { 0.0 };
        set.shooters((in_time as usize).clamp(LEAST_PAIRS, MOST_PAIRS))
    }

    /// How many jobs are computed at the same time now.
    pub fn threads(&self) -> usize {
        self.service.threads().max(1)
    }

    /// Has wishes computed until there are no more, a bounded number of them at a time, and hands over the answers in the order of the wishes, each
    /// with what was given beside its wish. No other job may be under way.
    pub fn in_order<T>(
        &mut self,
        mut wishes: impl FnMut(&Self) -> Option<(T, Wish)>,
        mut take: impl FnMut(T, FinishedJob),
    ) -> Result<(), BakeError> {
        let mut under_way = VecDeque::new();
        let mut arrived: BTreeMap<u64, FinishedJob> = BTreeMap::new();
        let (mut submitted, mut taken) = (0, 0);
        loop {
            while under_way.len() < MOST_UNDER_WAY
                && let Some((beside, wish)) = wishes(self)
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
        let pairs = wish.shooters.len() * wish.set.pairs;
        self.jobs.insert(job, Asked { tag, again: wish.again, pairs });
        let request = RowRequest {
            scene: if wish.set.is_scene { wish.set.digest } else { self.scene },
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
            self.check()?;
            let Some(finished) = self.service.next(PATIENCE)? else { continue };
            if let Some(Asked { tag, again, pairs }) = self.jobs.remove(&finished.job) {
                for (row, again) in finished.statistics.iter().zip(again) {
                    self.count(row, again);
                }
                self.visible_factors += finished.rows.iter().map(|row| row.count() as u64).sum::<u64>();
                let busy: u64 = finished.statistics.iter().map(|row| row.busy_nanoseconds).sum();
                self.pace = (self.pace.0 + pairs as f64, self.pace.1 + busy as f64);
                self.observer.progress(&self.progress);
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

    /// Number of factors that are not 0, of all rows that came.
    pub fn visible_factors(&self) -> u64 {
        self.visible_factors
    }

    /// So many more rows will be needed.
    pub fn expect_rows(&mut self, rows: u64) {
        self.progress.rows_needed = (self.progress.rows + rows).max(self.progress.rows_needed);
    }

    /// A step begins.
    pub fn enter(&mut self, phase: Phase, vertices: usize) {
        self.progress.phase = phase;
        self.progress.vertices = vertices;
        self.observer.progress(&self.progress);
    }

    /// An error once the bake is not wanted any more.
    pub fn check(&mut self) -> Result<(), BakeError> {
        if self.observer.is_cancelled() { Err(BakeError::Cancelled) } else { Ok(()) }
    }

    /// Whether the observer wants the present state.
    pub fn wants_present(&mut self) -> bool {
        self.observer.wants_present()
    }

    /// Hands the present state to the observer.
    pub fn present(&mut self, lit: LitMesh) {
        self.observer.present(lit);
    }

    /// The step under way.
    pub fn phase(&self) -> Phase {
        self.progress.phase
    }

    /// The unshot flux, relative to the reflected.
    pub fn set_unshot(&mut self, unshot: f64) {
        self.progress.unshot = unshot;
    }

    /// The error of the present answer, once it is known.
    pub fn set_error(&mut self, error: Option<f64>) {
        self.progress.error = error;
    }
}

impl Drop for RowOffice<'_> {
    /// However the bake ends, nothing of it stays with the service.
    fn drop(&mut self) {
        if !self.jobs.is_empty() {
            self.service.withdraw();
        }
        for digest in self.published.keys() {
            self.service.release(*digest);
        }
    }
}
