//! Invariants between any two events.

use std::collections::BTreeSet;

use kernel::row::JobId;

use super::choice::Place;
use super::event::WorkerId;
use super::index::Index;
use super::state::Scheduler;
use super::worker::{ReplicaState, Worker};

impl Scheduler {
    /// Checks the invariants between two events: no job is lost, none has more than two copies, suspects are alone, and
    /// no worker idles that could work, unless the policy has jobs wait.
    ///
    /// # Panics
    /// When it does not: the scheduler has a bug.
    pub fn sanity_check(&self) {
        self.check_jobs();
        let loading = self.workers.values().flat_map(|worker| {
            let loading = worker.replicas.iter().filter(|(_, state)| **state == ReplicaState::Loading);
            loading.map(move |(digest, _)| (*digest, worker.id))
        });
        self.spread.sanity_check(&loading.collect());
        let mut fresh = Index::default();
        for worker in self.workers.values() {
            worker.under_way.iter().for_each(|held| fresh.note(worker.id, held));
            let mut copy = worker.clone();
            copy.standing = None;
            copy.place(&mut fresh);
            assert_eq!(worker.standing, copy.standing, "{:?} is where it belongs", worker.id);
        }
        self.index.sanity_check(fresh, self.rounds);
        for (&id, worker) in &self.workers {
            worker.sanity_check();
            self.check_held(id, worker);
            if !self.policy.waits() {
                self.check_at_work(id, worker);
            }
        }
        if !self.policy.waits() {
            for job in self.queue.suspects() {
                let place = self.place_of(job);
                assert!(
                    !matches!(place, Some(Place::Empty(_))),
                    "the suspect {job:?} waits beside an empty worker"
                );
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

    /// Workers hold the jobs that name them as holders.
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
            let (job, missing) = self.next_for(id);
            assert_eq!(job, None, "{id:?} has room for a job that waits");
            let is_loading = missing.iter().all(|digest| worker.replicas.contains_key(digest));
            assert!(is_loading, "{id:?} has room for a job whose replicas nobody loads");
        }
        if worker.is_idle() && self.reserved != Some(id) {
            self.check_help(id, worker);
        }
    }

    /// An idle worker could not help: with what waits for the threads of another worker, or, where no copy is under way, with
    /// anything.
    fn check_help(&self, id: WorkerId, worker: &Worker) {
        let helped = self.index.news_is_due(self.rounds);
        for held in self.workers.values().flat_map(|worker| &worker.under_way) {
            if !held.wanted || held.twice || (helped && held.begun.is_some()) {
                continue;
            }
            let job = &self.jobs[&held.job];
            assert!(
                !self.may_copy(id, job) || !worker.holds(&job.kind.needs) || job.holders.contains(&id),
                "{id:?} idles, and nobody helps with {:?}",
                held.job
            );
        }
    }
}
