//! Submits jobs and receives their rows.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use kernel::geometry::ConvexPolygon;
use kernel::replica::{Digest, EncodedReplica, Receivers, encode_receivers, encode_translucent_scene};
use kernel::row::{FinishedJob, JobId, Precision, Row, RowRequest, Shape, Shooter};
use kernel::visibility::MANY_POLYGONS;

use super::monitor::Monitor;
use super::sizes::Pace;
use super::time::{Division, ThreadTime};
use crate::error::{BakeError, Result};
use crate::observer::Observer;

/// Least jobs under way where rows are requested in bulk, however few threads there are.
const LEAST_UNDER_WAY: usize = 64;

/// Most pairs under way where rows are requested in bulk: rows that wait for their turn take half a gigabyte at most.
const MOST_PAIRS_UNDER_WAY: usize = 1 << 27;

/// Cost of a ray of a hemisphere, in pairs.
const PAIRS_PER_RAY: usize = 4;

/// Receivers of a part of a row, where there are few rows: a multiple of the groups that receivers and factors come in.
const RANGE: usize = 1 << 14;

/// The same of rows whose shooters have many polygons, like the pieces of a sky: each pair takes some hundred times as long.
const RANGE_OF_MANY: usize = 1 << 10;

/// From this number of rows on, all threads have work without any row being cut.
const FEW_ROWS: usize = 64;

/// Longest wait for rows before the observer is asked again whether the bake is cancelled.
const PATIENCE: Duration = Duration::from_millis(100);

/// Clients opened by this process. Job ids of two clients with the same workers must differ: withdrawn jobs may be answered late.
static CLIENTS: AtomicU64 = AtomicU64::new(0);

/// More jobs than a client ever submits.
const JOBS_OF_CLIENT: u64 = 1 << 40;

/// Computes rows: a cluster of workers, in this process or elsewhere.
pub trait RowService {
    /// Publishes a replica before the first job that needs it. One may be published several times.
    fn publish(&mut self, replica: EncodedReplica);
    /// Takes back one [`Self::publish`]. No job needs the replica after the last one.
    fn release(&mut self, digest: Digest);
    /// Requests rows; earlier requests are more urgent. No job id may be used twice.
    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>);
    /// Forgets all unanswered jobs: none of them is answered any more.
    fn withdraw(&mut self);
    /// Returns how many jobs are computed at the same time now.
    fn threads(&self) -> usize {
        1
    }
    /// Returns how many jobs keep all threads busy: those computed, those that wait there, and those on their way.
    fn jobs_ahead(&self) -> usize {
        4 * self.threads()
    }
    /// Returns what the threads of the workers did so far; nothing where that is not known.
    fn thread_time(&self) -> ThreadTime {
        ThreadTime::default()
    }
    /// Waits for the next finished job, in any order. `None` where there is none within about `patience`.
    ///
    /// # Errors
    /// When no more rows can be had.
    fn next(&mut self, patience: Duration) -> Result<Option<FinishedJob>, BakeError>;
}

impl<S: RowService + ?Sized> RowService for &mut S {
    fn publish(&mut self, replica: EncodedReplica) {
        (**self).publish(replica);
    }

    fn release(&mut self, digest: Digest) {
        (**self).release(digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        (**self).submit(requests);
    }

    fn withdraw(&mut self) {
        (**self).withdraw();
    }

    fn threads(&self) -> usize {
        (**self).threads()
    }

    fn jobs_ahead(&self) -> usize {
        (**self).jobs_ahead()
    }

    fn thread_time(&self) -> ThreadTime {
        (**self).thread_time()
    }

    fn next(&mut self, patience: Duration) -> Result<Option<FinishedJob>, BakeError> {
        (**self).next(patience)
    }
}

/// A published set that rows are over: of receivers, or of polygons that receivers see.
#[derive(Debug, Clone, Copy)]
pub struct ReceiverSet {
    digest: Digest,
    /// First receiver of the range.
    first: usize,
    count: usize,
    /// Cost of a row, in pairs.
    pairs: usize,
    /// The set is a scene of its own: rows are over its polygons.
    is_scene: bool,
}

impl ReceiverSet {
    /// Number of receivers.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The set in consecutive parts of this many receivers.
    fn parts(self, receivers: usize) -> impl Iterator<Item = Self> {
        (0..self.count).step_by(receivers).map(move |first| {
            let count = receivers.min(self.count - first);
            Self { first: self.first + first, count, pairs: count, ..self }
        })
    }

    /// The same where rows are over its polygons, with this number of rays.
    #[must_use]
    pub fn seen_by(self, rays: u32) -> Self {
        // A ray through the scene takes about as long as some pairs with little between.
        Self { pairs: PAIRS_PER_RAY * rays as usize, ..self }
    }
}

/// Whether the polygons of a shooter are many enough to compute their rows together.
fn has_many_polygons(shooter: &Shooter) -> bool {
    match &shooter.shape {
        Shape::Polygons(polygons) => polygons.len() >= MANY_POLYGONS,
        Shape::Weighted(_) => true,
        _ => false,
    }
}

/// The rows of one job.
pub struct RowBatch {
    /// One row each.
    pub shooters: Vec<Shooter>,
    /// Over all receivers of a set.
    pub set: ReceiverSet,
    /// Which of these rows were made before: they do not count as what the scene needs.
    pub again: Vec<bool>,
}

impl RowBatch {
    /// Its cost, in pairs.
    fn pairs(&self) -> usize {
        self.shooters.len() * self.set.pairs
    }
}

/// A job under way.
struct PendingJob {
    /// The caller's name for it.
    tag: u64,
    /// Which of its rows were made before.
    again: Vec<bool>,
    pairs: usize,
}

/// Submits jobs for one scene to a [`RowService`]. When dropped, it leaves nothing with the service.
pub struct RowClient<'a> {
    service: &'a mut dyn RowService,
    scene: Digest,
    /// Published replicas. Two may have the same content.
    published: Vec<Digest>,
    precision: Precision,
    jobs: HashMap<JobId, PendingJob>,
    pace: Pace,
    next_job: u64,
    started: Instant,
    division: Division,
    /// Progress and counters.
    pub monitor: Monitor<'a>,
}

impl<'a> RowClient<'a> {
    /// Publishes a scene, for a bake that began at `started`, when threads had worked this long.
    pub fn new(
        service: &'a mut dyn RowService,
        observer: &'a mut dyn Observer,
        scene: EncodedReplica,
        (started, threads): (Instant, ThreadTime),
    ) -> Self {
        let digest = scene.digest;
        service.publish(scene);
        Self {
            service,
            scene: digest,
            published: vec![digest],
            precision: Precision::DEFAULT,
            jobs: HashMap::new(),
            pace: Pace::default(),
            next_job: CLIENTS.fetch_add(1, Ordering::Relaxed) * JOBS_OF_CLIENT,
            started,
            division: Division::new(threads),
            monitor: Monitor::new(observer),
        }
    }

    /// Precision of rows submitted from now on.
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// Sets the precision of rows submitted from now on.
    pub fn set_precision(&mut self, precision: Precision) {
        self.precision = precision;
    }

    /// Publishes a set of receivers.
    pub fn publish_receivers(&mut self, receivers: &Receivers) -> ReceiverSet {
        let replica = encode_receivers(receivers);
        let count = receivers.receivers.len();
        let set = ReceiverSet { digest: replica.digest, first: 0, count, pairs: count, is_scene: false };
        self.publish(replica);
        set
    }

    /// Publishes polygons that hemisphere rows are over, with the opacity of each, or none where all are opaque.
    pub fn publish_polygons(&mut self, polygons: &[ConvexPolygon], opacities: &[f32]) -> ReceiverSet {
        let replica = encode_translucent_scene(polygons, opacities);
        let count = polygons.len();
        let set = ReceiverSet { digest: replica.digest, first: 0, count, pairs: count, is_scene: true };
        self.publish(replica);
        set.seen_by(self.precision.rays_per_hemisphere)
    }

    fn publish(&mut self, replica: EncodedReplica) {
        self.published.push(replica.digest);
        self.service.publish(replica);
    }

    /// Releases a published set.
    pub fn release(&mut self, set: ReceiverSet) {
        if let Some(index) = self.published.iter().position(|digest| *digest == set.digest) {
            self.published.swap_remove(index);
            self.service.release(set.digest);
        }
    }

    /// Makes the rows of these shooters over a set and hands them over in order: index, row, and the variance from sampling,
    /// summed over the row.
    pub fn each_row(
        &mut self,
        shooters: &[Shooter],
        set: ReceiverSet,
        mut take: impl FnMut(usize, &Row, f64),
    ) -> Result<()> {
        let range = if shooters.iter().any(has_many_polygons) { RANGE_OF_MANY } else { RANGE };
        if !set.is_scene && set.count > range && shooters.len() < FEW_ROWS {
            return self.each_row_in_parts(shooters, set, range, take);
        }
        self.monitor.expect_rows(shooters.len() as u64);
        let (mut asked, mut next) = (0, 0);
        let batches = |client: &Self| {
            let count = client.rows_of_next_job(set, shooters.len() - asked);
            let some = &shooters[asked..asked + count];
            asked += count;
            let batch = RowBatch { shooters: some.to_vec(), set, again: vec![false; count] };
            (count > 0).then_some(((), batch))
        };
        self.in_order(batches, |(), finished| {
            for (row, statistics) in finished.rows.iter().zip(&finished.statistics) {
                take(next, row, statistics.sampling_variance);
                next += 1;
            }
        })
    }

    /// The same where few rows over many receivers would leave most threads without work.
    fn each_row_in_parts(
        &mut self,
        shooters: &[Shooter],
        set: ReceiverSet,
        range: usize,
        mut take: impl FnMut(usize, &Row, f64),
    ) -> Result<()> {
        let mut jobs = shooters.iter().flat_map(|shooter| set.parts(range).map(move |part| (shooter, part)));
        let parts = set.count.div_ceil(range);
        self.monitor.expect_rows((shooters.len() * parts) as u64);
        let batches = |_: &Self| {
            let (shooter, set) = jobs.next()?;
            Some(((), RowBatch { shooters: vec![shooter.clone()], set, again: vec![false] }))
        };
        let (mut next, mut rows, mut variance) = (0, Vec::with_capacity(parts), 0.0);
        self.in_order(batches, |(), finished| {
            rows.extend(finished.rows);
            variance +=
                finished.statistics.iter().map(|statistics| statistics.sampling_variance).sum::<f64>();
            if rows.len() == parts {
                take(next, &Row::joined(&rows), variance);
                (next, variance) = (next + 1, 0.0);
                rows.clear();
            }
        })
    }

    /// Rows that the next job of a batch over a set should have, given the number left.
    pub fn rows_of_next_job(&self, set: ReceiverSet, left: usize) -> usize {
        self.pace.rows_of_next_job(set.pairs, left, self.threads())
    }

    /// How many rows a job over a set should have at most.
    pub fn most_rows(&self, set: ReceiverSet) -> usize {
        self.pace.most_rows(set.pairs)
    }

    /// How many jobs are computed at the same time now.
    pub fn threads(&self) -> usize {
        self.service.threads().max(1)
    }

    /// How many jobs keep all threads busy.
    pub fn jobs_ahead(&self) -> usize {
        self.service.jobs_ahead().max(1)
    }

    /// Submits batches until there are no more, a bounded number at a time, and hands over the answers in the order of the
    /// batches, each with its tag. No other job may be under way.
    pub fn in_order<T>(
        &mut self,
        mut batches: impl FnMut(&Self) -> Option<(T, RowBatch)>,
        mut take: impl FnMut(T, FinishedJob),
    ) -> Result<()> {
        let mut under_way = VecDeque::new();
        let mut arrived: BTreeMap<u64, FinishedJob> = BTreeMap::new();
        let (mut submitted, mut taken, mut pairs_under_way) = (0, 0, 0);
        loop {
            // Answers that wait for an earlier one keep no thread busy.
            let most = self.jobs_ahead().max(LEAST_UNDER_WAY);
            while under_way.len() - arrived.len() < most
                && pairs_under_way < MOST_PAIRS_UNDER_WAY
                && let Some((tag, batch)) = batches(self)
            {
                let pairs = batch.pairs();
                pairs_under_way += pairs;
                under_way.push_back((tag, pairs));
                self.submit(submitted, batch);
                submitted += 1;
            }
            if under_way.is_empty() {
                return Ok(());
            }
            let (number, finished) = self.next()?;
            arrived.insert(number, finished);
            while let Some(finished) = arrived.remove(&taken)
                && let Some((tag, pairs)) = under_way.pop_front()
            {
                pairs_under_way -= pairs;
                take(tag, finished);
                taken += 1;
            }
        }
    }

    /// Submits one job, to be known by `tag`.
    pub fn submit(&mut self, tag: u64, batch: RowBatch) {
        let job = JobId(self.next_job);
        self.next_job += 1;
        let pairs = batch.pairs();
        self.jobs.insert(job, PendingJob { tag, again: batch.again, pairs });
        let request = RowRequest {
            scene: if batch.set.is_scene { batch.set.digest } else { self.scene },
            receivers: batch.set.digest,
            first_receiver: batch.set.first as u32,
            receiver_count: batch.set.count as u32,
            shooters: batch.shooters,
            precision: self.precision,
        };
        self.service.submit(vec![(job, request)]);
    }

    /// The bake has waited for rows until now, or done something else.
    fn pass(&mut self, waited: bool) {
        self.division.pass(self.started.elapsed().as_secs_f64(), self.service.thread_time(), waited);
        let busy = Duration::from_nanos(self.monitor.statistics.busy_nanoseconds);
        self.monitor.set_time(self.division.parts(busy));
    }

    /// Ends a step of the coordinator's own arithmetic: its seconds without work for the threads of the workers.
    pub fn end_step(&mut self) -> f64 {
        self.pass(false);
        self.division.end_step()
    }

    /// Waits for the next job, in any order: its tag and its rows.
    pub fn next(&mut self) -> Result<(u64, FinishedJob)> {
        loop {
            self.monitor.check()?;
            self.pass(false);
            let next = self.service.next(PATIENCE);
            self.pass(true);
            let Some(finished) = next? else { continue };
            if let Some(PendingJob { tag, again, pairs }) = self.jobs.remove(&finished.job) {
                self.pace.add(pairs, self.monitor.count(&finished, &again));
                return Ok((tag, finished));
            }
        }
    }
}

impl Drop for RowClient<'_> {
    /// However the bake ends, nothing of it stays with the service.
    fn drop(&mut self) {
        if !self.jobs.is_empty() {
            self.service.withdraw();
        }
        for digest in &self.published {
            self.service.release(*digest);
        }
    }
}
