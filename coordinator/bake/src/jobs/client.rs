//! Submits jobs and receives their rows.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use kernel::geometry::ConvexPolygon;
use kernel::replica::{Digest, EncodedReplica, Receivers, encode_receivers, encode_translucent_scene};
use kernel::row::{FinishedJob, JobId, Precision, Row, RowRequest, Shooter};

use super::monitor::Monitor;
use super::plan::{Piece, Plan, ReceiverSet, end_of_channels};
use super::service::RowService;
use super::sizes::{Pace, RowKind};
use super::time::{Division, ThreadTime};
use crate::error::Result;
use crate::observer::Observer;

/// Least jobs under way where rows are requested in bulk, however few threads there are.
const LEAST_UNDER_WAY: usize = 64;

/// Most pairs under way where rows are requested in bulk: rows that wait for their turn take half a gigabyte at most.
const MOST_PAIRS_UNDER_WAY: usize = 1 << 27;

/// Longest wait for rows before the observer is asked again whether the bake is cancelled.
const PATIENCE: Duration = Duration::from_millis(100);

/// Clients opened by this process. Job ids of two clients with the same workers must differ: withdrawn jobs may be answered late.
static CLIENTS: AtomicU64 = AtomicU64::new(0);

/// More jobs than a client ever submits.
const JOBS_OF_CLIENT: u64 = 1 << 40;

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
    kind: RowKind,
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
        let set = ReceiverSet { digest: replica.digest, first: 0, count, pairs: count, kind: RowKind::Plain };
        self.publish(replica);
        set
    }

    /// Publishes polygons that hemisphere rows are over, with the opacity of each, or none where all are opaque. After them such rows have
    /// the sky.
    pub fn publish_polygons(&mut self, polygons: &[ConvexPolygon], opacities: &[f32]) -> ReceiverSet {
        let replica = encode_translucent_scene(polygons, opacities);
        let count = polygons.len() + 1;
        let set =
            ReceiverSet { digest: replica.digest, first: 0, count, pairs: count, kind: RowKind::Hemispheres };
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

    /// Makes the rows of these shooters over some sets and hands them over, those of the first set first, in order: set, row, its
    /// factors, and the variance from sampling, summed over the row. Jobs of a set do not wait for those of the sets before.
    pub fn each_row(
        &mut self,
        shooters: &[Shooter],
        sets: &[ReceiverSet],
        mut take: impl FnMut(usize, usize, &Row, f64),
    ) -> Result<()> {
        let plans: Vec<Plan> = sets.iter().map(|set| Plan::new(shooters, *set)).collect();
        let count = |plan: &Plan| plan.pieces.as_ref().map_or(shooters.len(), Vec::len);
        let rows = |plan: &Plan| match &plan.pieces {
            Some(pieces) => pieces.iter().map(|piece| piece.shooters.len()).sum(),
            None => shooters.len(),
        };
        self.monitor.expect_rows(plans.iter().map(rows).sum::<usize>() as u64);
        let (mut place, mut asked) = (0, 0);
        let batches = |client: &Self| {
            while asked == count(plans.get(place)?) {
                (place, asked) = (place + 1, 0);
            }
            let Plan { set, pieces } = &plans[place];
            let Piece { shooters: some, set, is_last } = match pieces {
                Some(pieces) => {
                    asked += 1;
                    pieces[asked - 1].clone()
                }
                None => {
                    let end = asked + client.rows_of_next_job(*set, shooters.len() - asked);
                    let shooters = asked..end_of_channels(shooters, end);
                    asked = shooters.end;
                    Piece { shooters, set: *set, is_last: true }
                }
            };
            let batch =
                RowBatch { shooters: shooters[some.clone()].to_vec(), set, again: vec![false; some.len()] };
            Some(((place, some.start, is_last), batch))
        };
        // The parts of the rows of one or more shooters, and their variances.
        let mut parts: Vec<(Vec<Row>, f64)> = vec![];
        self.in_order(batches, |(place, first, is_last), finished| {
            parts.resize(finished.rows.len(), (vec![], 0.0));
            for ((rows, variance), (row, own)) in
                parts.iter_mut().zip(finished.rows.into_iter().zip(finished.statistics))
            {
                rows.push(row);
                *variance += own.sampling_variance;
            }
            if is_last {
                for (at, (rows, variance)) in parts.drain(..).enumerate() {
                    match &rows[..] {
                        [row] => take(place, first + at, row, variance),
                        rows => take(place, first + at, &Row::joined(rows), variance),
                    }
                }
            }
        })
    }

    /// Rows that the next job of a batch over a set should have, given the number left.
    pub fn rows_of_next_job(&self, set: ReceiverSet, left: usize) -> usize {
        self.pace.rows_of_next_job(set.kind, set.pairs, left, self.threads())
    }

    /// How many rows a job over a set should have at most.
    pub fn most_rows(&self, set: ReceiverSet) -> usize {
        self.pace.most_rows(set.kind, set.pairs)
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
        self.jobs.insert(job, PendingJob { tag, again: batch.again, kind: batch.set.kind, pairs });
        let request = RowRequest {
            scene: if batch.set.kind == RowKind::Hemispheres { batch.set.digest } else { self.scene },
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
            if let Some(PendingJob { tag, again, kind, pairs }) = self.jobs.remove(&finished.job) {
                self.pace.add(kind, pairs, self.monitor.count(&finished, &again));
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
