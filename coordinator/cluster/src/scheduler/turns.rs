//! The handle whose job goes next, where several share the workers. Pure: no clock, no thread.
//!
//! Fair queueing by the work done. The *service* of a handle is the time that workers computed for it, divided by its weight. Among
//! handles with a waiting job the one of least service goes next: a long queue does not starve a short one, and a job counts for what
//! it costs. The cost is known with the answer; until then a job is charged with the mean of its handle's earlier ones. A handle
//! without jobs saves nothing up: it begins again where the others are.

use std::collections::{BTreeMap, HashMap, VecDeque};

use kernel::row::JobId;

/// Names a handle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct HandleId(pub u64);

/// Nanoseconds charged for a job before any of its handle was answered. Those of a small job: what is charged too much by then, others
/// that join meanwhile would have to wait for.
const FIRST_GUESS: f64 = 30e3;

/// Jobs that workers have per thread: one that is computed, one that waits there, one on its way.
const JOBS_PER_THREAD: usize = 3;

/// Jobs that workers have in addition, so that one that joins finds some.
const JOBS_AHEAD: usize = 2;

/// All handles and their jobs.
#[derive(Debug, Default)]
pub struct Turns {
    handles: BTreeMap<HandleId, Account>,
    /// Service of the handle that went last, when it went.
    reached: f64,
}

#[derive(Debug)]
struct Account {
    weight: f64,
    /// Nanoseconds computed for it, over its weight.
    service: f64,
    waiting: VecDeque<JobId>,
    /// Jobs that workers have, each with the nanoseconds that it was charged with.
    under_way: HashMap<JobId, f64>,
    /// Jobs that were answered, and their nanoseconds.
    answered: (f64, f64),
}

impl Account {
    fn guess(&self) -> f64 {
        let (jobs, nanoseconds) = self.answered;
        if nanoseconds > 0.0 { nanoseconds / jobs } else { FIRST_GUESS }
    }
}

impl Turns {
    /// One more handle. Where all are busy it gets `weight` over the sum of all weights.
    pub fn join(&mut self, handle: HandleId, weight: f64) {
        let (waiting, under_way) = (VecDeque::new(), HashMap::new());
        let account = Account { weight, service: self.reached, waiting, under_way, answered: (0.0, 0.0) };
        self.handles.insert(handle, account);
    }

    /// A handle leaves with all its jobs. Returns those that workers have.
    pub fn leave(&mut self, handle: HandleId) -> Vec<JobId> {
        let jobs = self.withdraw(handle);
        self.handles.remove(&handle);
        jobs
    }

    /// A handle has one more job.
    pub fn submit(&mut self, handle: HandleId, job: JobId) {
        let Some(account) = self.handles.get_mut(&handle) else { return };
        if account.waiting.is_empty() && account.under_way.is_empty() {
            account.service = account.service.max(self.reached);
        }
        account.waiting.push_back(job);
    }

    /// Takes the job that goes next, of all that wait; none while workers have enough for this many threads, and for those of them
    /// that hold `ahead` jobs more because they are far away.
    pub fn next(&mut self, threads: usize, ahead: usize) -> Option<JobId> {
        if self.under_way() >= JOBS_PER_THREAD * threads + JOBS_AHEAD + ahead {
            return None;
        }
        let waiting = self.handles.values_mut().filter(|account| !account.waiting.is_empty());
        let account = waiting.min_by(|a, b| a.service.total_cmp(&b.service))?;
        let job = account.waiting.pop_front()?;
        let charged = account.guess();
        self.reached = self.reached.max(account.service);
        account.service += charged / account.weight;
        account.under_way.insert(job, charged);
        Some(job)
    }

    /// Workers answered a job, for which they computed this long.
    pub fn answered(&mut self, handle: HandleId, job: JobId, nanoseconds: f64) {
        let Some(account) = self.handles.get_mut(&handle) else { return };
        let Some(charged) = account.under_way.remove(&job) else { return };
        account.service += (nanoseconds - charged) / account.weight;
        account.answered = (account.answered.0 + 1.0, account.answered.1 + nanoseconds);
    }

    /// A handle withdraws all its jobs. Returns those that workers have.
    pub fn withdraw(&mut self, handle: HandleId) -> Vec<JobId> {
        let Some(account) = self.handles.get_mut(&handle) else { return vec![] };
        account.waiting.clear();
        let mut jobs: Vec<JobId> = std::mem::take(&mut account.under_way).into_keys().collect();
        jobs.sort_unstable();
        jobs
    }

    /// Number of jobs that workers have.
    pub fn under_way(&self) -> usize {
        self.handles.values().map(|account| account.under_way.len()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: HandleId = HandleId(1);
    const B: HandleId = HandleId(2);

    /// Threads for all jobs of these tests.
    const MANY: usize = 10_000;

    fn turns(weights: [f64; 2]) -> Turns {
        let mut turns = Turns::default();
        turns.join(A, weights[0]);
        turns.join(B, weights[1]);
        turns
    }

    /// Jobs below 1000 are A's.
    fn handle(job: JobId) -> HandleId {
        if job.0 < 1000 { A } else { B }
    }

    fn submit(turns: &mut Turns, jobs: impl IntoIterator<Item = u64>) {
        jobs.into_iter().for_each(|job| turns.submit(handle(JobId(job)), JobId(job)));
    }

    /// Runs so many jobs, one after the other, that take as long as `cost` says; how many of them were A's.
    fn run(turns: &mut Turns, count: usize, cost: impl Fn(HandleId) -> f64) -> usize {
        let run_one = |_: &usize| {
            let job = turns.next(MANY, 0).unwrap();
            let of = handle(job);
            turns.answered(of, job, cost(of));
            of == A
        };
        (0..count).filter(run_one).count()
    }

    #[test]
    fn jobs_of_a_handle_go_in_their_order() {
        let mut turns = turns([1.0, 1.0]);
        submit(&mut turns, 0..20);
        let order: Vec<u64> = std::iter::from_fn(|| turns.next(MANY, 0)).map(|job| job.0).collect();
        assert_eq!(order, (0..20).collect::<Vec<_>>());
        assert_eq!(turns.under_way(), 20);
    }

    #[test]
    fn a_long_queue_does_not_starve_who_comes_later() {
        let mut turns = turns([1.0, 1.0]);
        submit(&mut turns, 0..900);
        assert_eq!(run(&mut turns, 300, |_| 50.0), 300);
        submit(&mut turns, 1000..1100);
        assert_eq!(run(&mut turns, 200, |_| 50.0), 100);
    }

    #[test]
    fn work_counts_and_not_jobs() {
        let mut turns = turns([1.0, 1.0]);
        submit(&mut turns, 0..900);
        submit(&mut turns, 1000..1900);
        // A's jobs take three times as long, which is found out when they are answered.
        let a = run(&mut turns, 400, |handle| if handle == A { 300.0 } else { 100.0 });
        assert!((98..=102).contains(&a), "{a} of 400");
    }

    #[test]
    fn weights_divide_the_work() {
        let mut turns = turns([3.0, 1.0]);
        submit(&mut turns, 0..900);
        submit(&mut turns, 1000..1900);
        let a = run(&mut turns, 400, |_| 100.0);
        assert!((298..=302).contains(&a), "{a} of 400");
    }

    #[test]
    fn many_jobs_under_way_are_charged_before_they_are_answered() {
        let mut turns = turns([1.0, 1.0]);
        submit(&mut turns, 0..100);
        submit(&mut turns, 1000..1100);
        let first: Vec<HandleId> = (0..10).filter_map(|_| turns.next(MANY, 0)).map(handle).collect();
        assert_eq!(first.iter().filter(|handle| **handle == A).count(), 5, "{first:?}");
    }

    #[test]
    fn nobody_saves_up_while_it_has_nothing_to_do() {
        let mut turns = turns([1.0, 1.0]);
        submit(&mut turns, 1000..1001);
        assert_eq!(run(&mut turns, 1, |_| 100.0), 0);
        submit(&mut turns, 0..500);
        assert_eq!(run(&mut turns, 400, |_| 100.0), 400);
        submit(&mut turns, 1001..1200);
        let a = run(&mut turns, 100, |_| 100.0);
        assert!((49..=51).contains(&a), "{a} of 100");
    }

    #[test]
    fn jobs_of_who_is_gone_are_gone() {
        let mut turns = turns([1.0, 1.0]);
        submit(&mut turns, 0..10);
        submit(&mut turns, 1000..1010);
        let had: Vec<JobId> =
            (0..4).filter_map(|_| turns.next(MANY, 0)).filter(|job| handle(*job) == A).collect();
        assert_eq!(turns.leave(A), had);
        assert!(std::iter::from_fn(|| turns.next(MANY, 0)).all(|job| handle(job) == B));
        // Late answers do no harm.
        turns.answered(A, had[0], 1e9);
        assert_eq!(turns.withdraw(B).len(), 10);
        assert_eq!((turns.under_way(), turns.next(MANY, 0)), (0, None));
    }

    #[test]
    fn no_more_jobs_go_than_keep_all_threads_busy() {
        let mut turns = turns([1.0, 1.0]);
        submit(&mut turns, 0..20);
        let sent: Vec<JobId> = std::iter::from_fn(|| turns.next(2, 0)).collect();
        assert_eq!(sent.len(), 2 * JOBS_PER_THREAD + JOBS_AHEAD);
        turns.answered(A, sent[0], 1.0);
        assert_eq!((turns.next(2, 0), turns.next(2, 0)), (Some(JobId(8)), None));
        assert_eq!((turns.next(2, 1), turns.next(2, 1)), (Some(JobId(9)), None), "one is far away");
    }
}
