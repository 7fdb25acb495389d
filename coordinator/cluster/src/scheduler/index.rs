//! Workers, and the jobs that they hold, in the orders in which decisions take them: a decision looks at the first of an order and
//! not at all workers, so that an event costs O(log n).

use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::ops::Bound;

use kernel::row::JobId;

use super::event::WorkerId;
use super::held::{Candidate, Held, Load, Standing};
use super::job::{Kind, Queue};

/// Rounds after which a job that is computed is overdue. At the end of a batch, when no more jobs follow, n busy threads
/// become one in ln n rounds: of 64 the last three are then given to others, of which there are plenty.
pub(super) const PATIENCE: f64 = 3.0;

/// A time in rounds, as bits: it is never negative, so that these have its order.
fn in_order(rounds: f64) -> u64 {
    rounds.to_bits()
}

/// The orders.
#[derive(Debug, Default)]
pub(super) struct Index {
    /// Workers with room that a waiting job may suit.
    open: BTreeSet<Load>,
    /// Workers with room that no job of a considered kind suits: they wait for replicas.
    blocked: BTreeSet<WorkerId>,
    /// Kinds of jobs that all blocked workers were considered for.
    considered: BTreeSet<Kind>,
    idle: BTreeSet<Load>,
    /// Threads that compute.
    busy: usize,
    /// Threads without a job of workers to which a replica is on its way.
    loading: usize,
    /// Of each worker the deepest job in line that nobody else holds: deepest first.
    waiting: BTreeSet<(Reverse<usize>, Candidate)>,
    /// Jobs computed in time that nobody else holds, by when they were begun, and by order.
    begun: BTreeSet<(u64, Candidate)>,
    in_time: BTreeSet<Candidate>,
    /// Jobs computed for too long that nobody else holds.
    overdue: BTreeSet<Candidate>,
    /// Second copies that wait for a thread, and when the others were begun.
    copies_waiting: usize,
    copies_begun: BTreeSet<(u64, WorkerId, JobId)>,
}

impl Index {
    /// Threads that compute.
    pub(super) fn busy(&self) -> usize {
        self.busy
    }

    /// Threads without a job of workers to which a replica is on its way.
    pub(super) fn loading(&self) -> usize {
        self.loading
    }

    /// A worker has changed, or is new. `was` is where it stood before.
    pub(super) fn place(&mut self, was: &mut Option<Standing>, standing: Standing) {
        if *was == Some(standing) && !self.blocked.contains(&standing.load.worker) {
            return;
        }
        self.remove(was);
        if standing.has_room {
            self.open.insert(standing.load);
        }
        if standing.is_idle {
            self.idle.insert(standing.load);
        }
        self.waiting.extend(standing.deepest);
        self.busy += standing.busy;
        self.loading += standing.loading;
        *was = Some(standing);
    }

    /// Removes a worker, but not the jobs that it holds.
    pub(super) fn remove(&mut self, was: &mut Option<Standing>) {
        let Some(standing) = was.take() else { return };
        self.open.remove(&standing.load);
        self.blocked.remove(&standing.load.worker);
        self.idle.remove(&standing.load);
        if let Some(deepest) = standing.deepest {
            self.waiting.remove(&deepest);
        }
        self.busy -= standing.busy;
        self.loading -= standing.loading;
    }

    /// A worker holds a job in this state.
    pub(super) fn note(&mut self, holder: WorkerId, held: &Held) {
        let begun = held.begun.map(in_order);
        if held.copy {
            match begun {
                Some(begun) => _ = self.copies_begun.insert((begun, holder, held.job)),
                None => self.copies_waiting += 1,
            }
        }
        if let Some(begun) = begun.filter(|_| held.is_free()) {
            let candidate = held.candidate(holder);
            self.begun.insert((begun, candidate));
            self.in_time.insert(candidate);
        }
    }

    /// A worker does not hold a job in this state any more.
    pub(super) fn forget(&mut self, holder: WorkerId, held: &Held) {
        let begun = held.begun.map(in_order);
        if held.copy {
            match begun {
                Some(begun) => _ = self.copies_begun.remove(&(begun, holder, held.job)),
                None => self.copies_waiting -= 1,
            }
        }
        if let Some(begun) = begun.filter(|_| held.is_free()) {
            let candidate = held.candidate(holder);
            let of =
                if self.begun.remove(&(begun, candidate)) { &mut self.in_time } else { &mut self.overdue };
            of.remove(&candidate);
        }
    }

    /// It is this many rounds after the start: jobs become overdue.
    pub(super) fn pass_time(&mut self, rounds: f64) {
        while let Some((begun, candidate)) = self.begun.first().copied()
            && rounds - f64::from_bits(begun) >= PATIENCE
        {
            self.begun.pop_first();
            self.in_time.remove(&candidate);
            self.overdue.insert(candidate);
        }
    }

    /// A second copy is under way, so that there will be news of it; one that is overdue itself promises nothing.
    pub(super) fn news_is_due(&self, rounds: f64) -> bool {
        let last = self.copies_begun.last();
        self.copies_waiting > 0 || last.is_some_and(|(begun, ..)| rounds - f64::from_bits(*begun) < PATIENCE)
    }

    /// The next worker, by load, that a waiting job may suit.
    pub(super) fn open_after(&self, last: Option<Load>) -> Option<Load> {
        after(&self.open, last)
    }

    /// The next idle worker, by load.
    pub(super) fn idle_after(&self, last: Option<Load>) -> Option<Load> {
        after(&self.idle, last)
    }

    /// Of the jobs that wait, none suits this worker with room. It is not asked again before it changes, or a job of another kind
    /// waits.
    pub(super) fn block(&mut self, load: Load, queue: &Queue) {
        if self.open.remove(&load) {
            if self.blocked.is_empty() {
                self.considered = queue.kinds().cloned().collect();
            } else {
                self.considered.retain(|kind| queue.has(kind));
            }
            self.blocked.insert(load.worker);
        }
    }

    /// Whether a job of this kind may suit a blocked worker.
    pub(super) fn may_suit_blocked(&self, kind: &Kind) -> bool {
        !self.blocked.is_empty() && !self.considered.contains(kind)
    }

    /// The blocked workers. Each is considered again once it is placed again.
    pub(super) fn blocked(&self) -> Vec<WorkerId> {
        self.blocked.iter().copied().collect()
    }

    /// Whether any job could be taken over; with `all`, those too that are computed in time.
    pub(super) fn has_candidates(&self, all: bool) -> bool {
        !self.overdue.is_empty() || !self.waiting.is_empty() || all && !self.in_time.is_empty()
    }

    /// Jobs that are overdue, in order.
    pub(super) fn overdue(&self) -> impl Iterator<Item = Candidate> + '_ {
        self.overdue.iter().copied()
    }

    /// Workers with jobs that wait for a thread and that nobody else holds: those with the longest line first.
    pub(super) fn with_lines(&self) -> impl Iterator<Item = WorkerId> + '_ {
        self.waiting.iter().map(|(_, candidate)| candidate.holder)
    }

    /// Jobs that are computed in time, in order.
    pub(super) fn in_time(&self) -> impl Iterator<Item = Candidate> + '_ {
        self.in_time.iter().copied()
    }

    /// Checks that this is the index of these workers' standings, of which a fresh one was made.
    ///
    /// # Panics
    /// When it is not.
    pub(super) fn sanity_check(&self, mut fresh: Self, rounds: f64) {
        for blocked in &self.blocked {
            let load = fresh.open.iter().find(|load| load.worker == *blocked).copied();
            assert!(load.is_some_and(|load| fresh.open.remove(&load)), "only workers with room are blocked");
            fresh.blocked.insert(*blocked);
        }
        fresh.pass_time(rounds);
        let all = |index: &Self| {
            let late: BTreeSet<Candidate> = index.overdue().chain(index.in_time()).collect();
            let workers = (index.open.clone(), index.blocked.clone(), index.idle.clone());
            let threads = (index.busy, index.loading);
            (workers, threads, index.waiting.clone(), late, index.copies_waiting, index.copies_begun.clone())
        };
        assert_eq!(all(self), all(&fresh), "the index is that of the workers");
        assert!(self.overdue.is_subset(&fresh.overdue), "only what is late is overdue");
    }
}

fn after(of: &BTreeSet<Load>, last: Option<Load>) -> Option<Load> {
    let from = last.map_or(Bound::Unbounded, Bound::Excluded);
    of.range((from, Bound::Unbounded)).next().copied()
}
