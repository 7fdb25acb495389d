//! Which job runs next: events in, actions out. Pure.
//!
//! Jobs of higher priority go first. Within a priority, clients take turns: the first job of each, then the second of each, and so
//! on, counting running jobs; so no client waits behind a thousand jobs of another. Jobs of one client keep their order.

use std::collections::{BTreeMap, HashMap};

use crate::job::{ClientName, JobId, Sequence};

/// Priority of a job; higher ones start first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Priority(pub i32);

/// A queued job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Waiting {
    /// Its client.
    pub client: ClientName,
    /// Its priority.
    pub priority: Priority,
    /// Its position in the order of submission.
    pub sequence: Sequence,
}

/// An event that the queue handles.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// A job was submitted.
    Submitted(JobId, Waiting),
    /// A job was cancelled or deleted.
    Withdrawn(JobId),
    /// A running job has ended.
    Left(JobId),
    /// A running job has stopped, and must run again.
    PutBack(JobId),
    /// Jobs may start.
    Opened,
    /// No more jobs may start.
    Closed,
}

/// An action that the queue asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Start this job: it occupies a slot until [`Event::Left`] or [`Event::PutBack`].
    Start(JobId),
    /// Stop this running job.
    Stop(JobId),
}

/// How many jobs run at the same time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Places {
    /// Jobs of all clients together.
    pub all: usize,
    /// Jobs of one client.
    pub of_a_client: usize,
}

/// Queued and running jobs.
#[derive(Debug)]
pub struct Queue {
    places: Places,
    waiting: BTreeMap<JobId, Waiting>,
    running: BTreeMap<JobId, Waiting>,
    closed: bool,
}

impl Queue {
    /// Creates an empty queue.
    #[must_use]
    pub fn new(places: Places) -> Self {
        Self { places, waiting: BTreeMap::new(), running: BTreeMap::new(), closed: false }
    }

    /// Handles an event, and returns the actions that follow.
    pub fn handle(&mut self, event: Event) -> Vec<Action> {
        match event {
            Event::Submitted(job, waiting) => {
                self.waiting.insert(job, waiting);
            }
            Event::Withdrawn(job) => {
                if self.waiting.remove(&job).is_none() && self.running.contains_key(&job) {
                    // Its slot becomes free when it has stopped.
                    return vec![Action::Stop(job)];
                }
            }
            Event::Left(job) => {
                self.running.remove(&job);
            }
            Event::PutBack(job) => {
                if let Some(again) = self.running.remove(&job) {
                    self.waiting.insert(job, again);
                }
            }
            Event::Opened => self.closed = false,
            Event::Closed => {
                self.closed = true;
                return self.running.keys().copied().map(Action::Stop).collect();
            }
        }
        self.fill()
    }

    /// Number of queued jobs.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Number of running jobs.
    #[must_use]
    pub fn running(&self) -> usize {
        self.running.len()
    }

    /// Returns the queued jobs in the order in which they would start if all took equally long.
    #[must_use]
    pub fn order(&self) -> Vec<JobId> {
        let mut by_time: Vec<_> = self.waiting.iter().collect();
        by_time.sort_by_key(|(_, waiting)| waiting.sequence);
        let running = self.running_by_client();
        let mut turns: HashMap<(&ClientName, Priority), usize> = HashMap::new();
        let mut order: Vec<_> = by_time
            .into_iter()
            .map(|(job, waiting)| {
                let Waiting { client, priority, sequence } = waiting;
                let turn = turns
                    .entry((client, *priority))
                    .or_insert_with(|| running.get(client).copied().unwrap_or_default());
                *turn += 1;
                (std::cmp::Reverse(*priority), *turn, *sequence, *job)
            })
            .collect();
        order.sort_unstable();
        order.into_iter().map(|(.., job)| job).collect()
    }

    fn running_by_client(&self) -> HashMap<&ClientName, usize> {
        let mut count = HashMap::new();
        for Waiting { client, .. } in self.running.values() {
            *count.entry(client).or_default() += 1;
        }
        count
    }

    /// Starts jobs in the free slots.
    fn fill(&mut self) -> Vec<Action> {
        let mut actions = vec![];
        while !self.closed && self.running.len() < self.places.all && !self.waiting.is_empty() {
            let running = self.running_by_client();
            let may_run = |job: &JobId| {
                let client = self.waiting.get(job).map(|waiting| &waiting.client);
                let has = client.and_then(|client| running.get(client)).copied().unwrap_or_default();
                has < self.places.of_a_client
            };
            let Some(job) = self.order().into_iter().find(may_run) else { break };
            let Some(waiting) = self.waiting.remove(&job) else { break };
            self.running.insert(job, waiting);
            actions.push(Action::Start(job));
        }
        actions
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn submitted(job: u128, client: &str, priority: i32) -> Event {
        let (client, priority) = (ClientName(client.into()), Priority(priority));
        Event::Submitted(JobId(job), Waiting { client, priority, sequence: Sequence(job as u64) })
    }

    fn queue(all: usize, of_a_client: usize) -> Queue {
        Queue::new(Places { all, of_a_client })
    }

    fn order(queue: &Queue) -> Vec<u128> {
        queue.order().into_iter().map(|job| job.0).collect()
    }

    #[test]
    fn jobs_start_when_there_is_a_slot() {
        let mut queue = queue(2, 2);
        assert_eq!(queue.handle(submitted(1, "a", 0)), [Action::Start(JobId(1))]);
        assert_eq!(queue.handle(submitted(2, "a", 0)), [Action::Start(JobId(2))]);
        assert_eq!(queue.handle(submitted(3, "a", 0)), []);
        assert_eq!(queue.handle(Event::Left(JobId(1))), [Action::Start(JobId(3))]);
        assert_eq!(queue.handle(Event::Left(JobId(2))), []);
        assert_eq!((queue.waiting(), queue.running()), (0, 1));
    }

    #[test]
    fn priority_goes_before_time_and_clients_take_turns() {
        let mut queue = queue(0, 9);
        for event in [submitted(1, "a", 0), submitted(2, "a", 0), submitted(3, "a", 0), submitted(4, "b", 0)]
        {
            queue.handle(event);
        }
        assert_eq!(order(&queue), [1, 4, 2, 3]);
        queue.handle(submitted(5, "b", 0));
        queue.handle(submitted(6, "a", 1));
        queue.handle(submitted(7, "c", -1));
        assert_eq!(order(&queue), [6, 1, 4, 2, 5, 3, 7]);
    }

    #[test]
    fn a_client_with_a_running_job_waits_for_those_without() {
        let mut queue = queue(1, 9);
        for event in [submitted(1, "a", 0), submitted(2, "a", 0), submitted(3, "b", 0)] {
            queue.handle(event);
        }
        assert_eq!(order(&queue), [3, 2]);
    }

    #[test]
    fn a_client_has_at_most_its_own_slots() {
        let mut queue = queue(3, 1);
        assert_eq!(queue.handle(submitted(1, "a", 0)), [Action::Start(JobId(1))]);
        assert_eq!(queue.handle(submitted(2, "a", 9)), []);
        assert_eq!(queue.handle(submitted(3, "b", 0)), [Action::Start(JobId(3))]);
        assert_eq!(queue.handle(Event::Left(JobId(1))), [Action::Start(JobId(2))]);
    }

    #[test]
    fn a_withdrawn_job_keeps_its_slot_until_it_has_stopped() {
        let mut queue = queue(1, 1);
        queue.handle(submitted(1, "a", 0));
        queue.handle(submitted(2, "a", 0));
        queue.handle(submitted(3, "a", 0));
        assert_eq!(queue.handle(Event::Withdrawn(JobId(2))), []);
        assert_eq!(queue.handle(Event::Withdrawn(JobId(1))), [Action::Stop(JobId(1))]);
        assert_eq!(queue.handle(Event::Withdrawn(JobId(9))), []);
        assert_eq!(queue.handle(Event::Left(JobId(1))), [Action::Start(JobId(3))]);
    }

    #[test]
    fn a_job_that_is_put_back_keeps_its_turn() {
        let mut queue = queue(1, 1);
        queue.handle(submitted(1, "a", 0));
        queue.handle(submitted(2, "a", 0));
        assert_eq!(queue.handle(Event::PutBack(JobId(1))), [Action::Start(JobId(1))]);
    }

    #[test]
    fn no_job_starts_after_the_end() {
        let mut queue = queue(1, 1);
        queue.handle(submitted(1, "a", 0));
        queue.handle(submitted(2, "a", 0));
        assert_eq!(queue.handle(Event::Closed), [Action::Stop(JobId(1))]);
        assert_eq!(queue.handle(Event::PutBack(JobId(1))), []);
        assert_eq!(queue.handle(submitted(3, "a", 0)), []);
        assert_eq!(queue.waiting(), 3);
    }
}
