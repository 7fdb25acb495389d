//! What must hold between any two events.

use std::collections::BTreeSet;

use super::worker::Worker;
use super::{JobId, Policy, Scheduler, WorkerId};

impl Scheduler {
    /// Checks what must hold between any two events: no job is lost, none has more than two copies, suspects are alone, and
    /// nobody idles who could work.
    ///
    /// # Panics
    /// When it does not: the scheduler has a bug.
    pub fn sanity_check(&self) {
        self.check_jobs();
        for (&id, worker) in &self.workers {
            worker.sanity_check();
            self.check_held(id, worker);
            // Between two ticks workers may run out of work.
            if self.policy == Policy::Finished {
                self.check_at_work(id, worker);
            }
        }
    }

    /// Each job either waits in its place or is under way, on one worker or on two.
    fn check_jobs(&self) {
        let unsuspected: BTreeSet<JobId> = self.queue.unsuspected().collect();
        let suspects: BTreeSet<JobId> = self.queue.suspects().collect();
        for (id, job) in &self.jobs {
            let places = [unsuspected.contains(id), suspects.contains(id), !job.holders.is_empty()];
            let waits = [!job.is_suspect(), job.is_suspect(), false];
            assert!(places == waits || places == [false, false, true], "{id:?} is in one place: {places:?}");
            let distinct: BTreeSet<_> = job.holders.iter().collect();
            assert!(
                distinct.len() == job.holders.len() && distinct.len() <= 2,
                "copies on two workers at most"
            );
            for holder in &job.holders {
                let held =
                    self.workers[holder].under_way.iter().filter(|held| held.job == *id && held.wanted);
                assert_eq!(held.count(), 1, "{holder:?} holds {id:?}");
            }
        }
        let known = |job: &JobId| self.jobs.contains_key(job);
        assert!(unsuspected.iter().chain(&suspects).all(known), "what waits is not over");
    }

    /// What a worker holds is what the jobs say.
    fn check_held(&self, id: WorkerId, worker: &Worker) {
        for held in &worker.under_way {
            match self.jobs.get(&held.job) {
                Some(job) => {
                    assert!(held.wanted && job.holders.contains(&id), "{id:?} holds {:?}", held.job);
                    assert_eq!(held.twice, job.holders.len() == 2);
                    assert_eq!(held.order, job.order);
                    assert!(!held.alone || job.is_suspect(), "only suspects are alone");
                }
                None => assert!(!held.wanted, "{:?} is over", held.job),
            }
        }
    }

    /// A worker has something to do if anything can be done.
    fn check_at_work(&self, id: WorkerId, worker: &Worker) {
        if self.reserved == Some(id) {
            assert!(
                self.queue.suspects().next().is_some(),
                "{id:?} is kept for a suspect, and there is none"
            );
        } else if worker.has_room() {
            for (_, job, kind) in self.queue.first_of_each_kind() {
                if self.may_try(id, kind) {
                    assert!(!worker.holds(&kind.needs), "{id:?} has room for {job:?}, which waits");
                    let is_loading = kind.needs.iter().all(|digest| worker.replicas.contains_key(digest));
                    assert!(is_loading, "{id:?} could compute {job:?}, but nobody loads its replicas");
                }
            }
        }
        for job in self.queue.suspects() {
            let kind = &self.jobs[&job].kind;
            let could = worker.under_way.is_empty() && self.may_try(id, kind) && worker.holds(&kind.needs);
            assert!(!could, "{id:?} is empty, and the suspect {job:?} waits");
        }
        if worker.is_idle() && self.reserved != Some(id) {
            self.check_help(id, worker);
        }
    }

    /// An idle worker could not help: with what waits for the threads of another worker, or, where no copy is under way, with
    /// anything.
    fn check_help(&self, id: WorkerId, worker: &Worker) {
        let helped = self.news_is_due();
        for held in self.workers.values().flat_map(|worker| &worker.under_way) {
            if !held.wanted || held.twice || (helped && held.begun.is_some()) {
                continue;
            }
            let job = &self.jobs[&held.job];
            let could = self.may_try(id, &job.kind)
                && worker.holds(&job.kind.needs)
                && (!job.is_suspect() || worker.under_way.is_empty());
            assert!(
                !could || job.holders.contains(&id),
                "{id:?} idles, and nobody helps with {:?}",
                held.job
            );
        }
    }
}
