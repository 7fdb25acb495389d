//! Whose job goes next, where several drivers share the workers. Pure: no clock, no thread.
//!
//! Fair queueing by the work that was done. Each driver has a *service*: the time that workers computed for it, divided by its
//! weight. Of the drivers with a job the one of least service goes next, so that a long queue does not starve a short one, and
//! jobs that cost much count for what they cost. What a job costs is known once it is answered: until then the driver is charged
//! with what its jobs have cost so far, by their size.
//!
//! Nobody saves up: a driver that had nothing to do begins again where those are that had.

use std::collections::{BTreeMap, HashMap, VecDeque};

use crate::scheduler::JobId;

/// Names a driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct DriverId(pub u64);

/// Nanoseconds for a pair of shooter and receiver, before any job of a driver was answered.
const FIRST_GUESS: f64 = 300.0;

/// All drivers and their jobs.
#[derive(Debug, Default)]
pub struct Sharing {
    drivers: BTreeMap<DriverId, Account>,
    /// Service of the driver that went last, when it went.
    reached: f64,
}

#[derive(Debug)]
struct Account {
    weight: f64,
    /// Nanoseconds computed for it, over its weight.
    service: f64,
    /// Jobs that wait, each with its pairs.
    waiting: VecDeque<(JobId, f64)>,
    /// Jobs that workers have, each with its pairs and the nanoseconds that it was charged with.
    under_way: HashMap<JobId, (f64, f64)>,
    /// Pairs of the jobs that were answered, and the nanoseconds that they took.
    pace: (f64, f64),
}

impl Account {
    fn guess(&self, pairs: f64) -> f64 {
        let (known, took) = self.pace;
        if known > 0.0 && took > 0.0 { pairs * took / known } else { pairs * FIRST_GUESS }
    }
}

impl Sharing {
    /// One more driver. Where all are busy it gets `weight` over the sum of all weights.
    pub fn join(&mut self, driver: DriverId, weight: f64) {
        let (waiting, under_way) = (VecDeque::new(), HashMap::new());
        let account = Account { weight, service: self.reached, waiting, under_way, pace: (0.0, 0.0) };
        self.drivers.insert(driver, account);
    }

    /// A driver is gone, with all its jobs: those of them that workers have.
    pub fn leave(&mut self, driver: DriverId) -> Vec<JobId> {
        let jobs = self.withdraw(driver);
        self.drivers.remove(&driver);
        jobs
    }

    /// A driver has one more job, of so many pairs of shooter and receiver.
    pub fn submit(&mut self, driver: DriverId, job: JobId, pairs: f64) {
        let Some(account) = self.drivers.get_mut(&driver) else { return };
        if account.waiting.is_empty() && account.under_way.is_empty() {
            account.service = account.service.max(self.reached);
        }
        account.waiting.push_back((job, pairs));
    }

    /// The job that goes next, of all that wait. From now on a worker has it.
    pub fn next(&mut self) -> Option<JobId> {
        let waiting = self.drivers.values_mut().filter(|account| !account.waiting.is_empty());
        let account = waiting.min_by(|a, b| a.service.total_cmp(&b.service))?;
        let (job, pairs) = account.waiting.pop_front()?;
        let charged = account.guess(pairs);
        self.reached = self.reached.max(account.service);
        account.service += charged / account.weight;
        account.under_way.insert(job, (pairs, charged));
        Some(job)
    }

    /// Workers answered a job, for which they computed so long.
    pub fn answered(&mut self, driver: DriverId, job: JobId, nanoseconds: f64) {
        let Some(account) = self.drivers.get_mut(&driver) else { return };
        let Some((pairs, charged)) = account.under_way.remove(&job) else { return };
        account.service += (nanoseconds - charged) / account.weight;
        account.pace = (account.pace.0 + pairs, account.pace.1 + nanoseconds);
    }

    /// A driver wants none of its jobs any more: those of them that workers have.
    pub fn withdraw(&mut self, driver: DriverId) -> Vec<JobId> {
        let Some(account) = self.drivers.get_mut(&driver) else { return vec![] };
        account.waiting.clear();
        let mut jobs: Vec<JobId> = std::mem::take(&mut account.under_way).into_keys().collect();
        jobs.sort_unstable();
        jobs
    }

    /// How many jobs workers have.
    pub fn under_way(&self) -> usize {
        self.drivers.values().map(|account| account.under_way.len()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: DriverId = DriverId(1);
    const B: DriverId = DriverId(2);

    fn sharing(weights: [f64; 2]) -> Sharing {
        let mut sharing = Sharing::default();
        sharing.join(A, weights[0]);
        sharing.join(B, weights[1]);
        sharing
    }

    /// Jobs below 1000 are A's.
    fn driver(job: JobId) -> DriverId {
        if job.0 < 1000 { A } else { B }
    }

    fn submit(sharing: &mut Sharing, jobs: impl IntoIterator<Item = u64>, pairs: f64) {
        jobs.into_iter().for_each(|job| sharing.submit(driver(JobId(job)), JobId(job), pairs));
    }

    /// Runs so many jobs, one after the other, that take as long as `cost` says; how many of them were A's.
    fn run(sharing: &mut Sharing, count: usize, cost: impl Fn(DriverId) -> f64) -> usize {
        let run_one = |_: &usize| {
            let job = sharing.next().unwrap();
            let of = driver(job);
            sharing.answered(of, job, cost(of));
            of == A
        };
        (0..count).filter(run_one).count()
    }

    #[test]
    fn jobs_of_a_driver_go_in_their_order() {
        let mut sharing = sharing([1.0, 1.0]);
        submit(&mut sharing, 0..20, 1.0);
        let order: Vec<u64> = std::iter::from_fn(|| sharing.next()).map(|job| job.0).collect();
        assert_eq!(order, (0..20).collect::<Vec<_>>());
        assert_eq!(sharing.under_way(), 20);
    }

    #[test]
    fn a_long_queue_does_not_starve_who_comes_later() {
        let mut sharing = sharing([1.0, 1.0]);
        submit(&mut sharing, 0..900, 1.0);
        assert_eq!(run(&mut sharing, 300, |_| 50.0), 300);
        submit(&mut sharing, 1000..1100, 1.0);
        assert_eq!(run(&mut sharing, 200, |_| 50.0), 100);
    }

    #[test]
    fn work_counts_and_not_jobs() {
        let mut sharing = sharing([1.0, 1.0]);
        submit(&mut sharing, 0..900, 1.0);
        submit(&mut sharing, 1000..1900, 1.0);
        // A's jobs take three times as long, which is found out when they are answered.
        let a = run(&mut sharing, 400, |driver| if driver == A { 300.0 } else { 100.0 });
        assert!((98..=102).contains(&a), "{a} of 400");
    }

    #[test]
    fn weights_divide_the_work() {
        let mut sharing = sharing([3.0, 1.0]);
        submit(&mut sharing, 0..900, 1.0);
        submit(&mut sharing, 1000..1900, 1.0);
        let a = run(&mut sharing, 400, |_| 100.0);
        assert!((298..=302).contains(&a), "{a} of 400");
    }

    #[test]
    fn many_jobs_under_way_are_charged_before_they_are_answered() {
        let mut sharing = sharing([1.0, 1.0]);
        submit(&mut sharing, 0..100, 1.0);
        submit(&mut sharing, 1000..1100, 1.0);
        let first: Vec<DriverId> = (0..10).filter_map(|_| sharing.next()).map(driver).collect();
        assert_eq!(first.iter().filter(|driver| **driver == A).count(), 5, "{first:?}");
    }

    #[test]
    fn nobody_saves_up_while_it_has_nothing_to_do() {
        let mut sharing = sharing([1.0, 1.0]);
        submit(&mut sharing, 1000..1001, 1.0);
        assert_eq!(run(&mut sharing, 1, |_| 100.0), 0);
        submit(&mut sharing, 0..500, 1.0);
        assert_eq!(run(&mut sharing, 400, |_| 100.0), 400);
        submit(&mut sharing, 1001..1200, 1.0);
        let a = run(&mut sharing, 100, |_| 100.0);
        assert!((49..=51).contains(&a), "{a} of 100");
    }

    #[test]
    fn jobs_of_who_is_gone_are_gone() {
        let mut sharing = sharing([1.0, 1.0]);
        submit(&mut sharing, 0..10, 1.0);
        submit(&mut sharing, 1000..1010, 1.0);
        let had: Vec<JobId> = (0..4).filter_map(|_| sharing.next()).filter(|job| driver(*job) == A).collect();
        assert_eq!(sharing.leave(A), had);
        assert!(std::iter::from_fn(|| sharing.next()).all(|job| driver(job) == B));
        // Late answers do no harm.
        sharing.answered(A, had[0], 1e9);
        assert_eq!(sharing.withdraw(B).len(), 10);
        assert_eq!((sharing.under_way(), sharing.next()), (0, None));
    }
}
