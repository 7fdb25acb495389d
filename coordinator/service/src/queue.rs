//! Which job runs next: events in, actions out. Pure.
//!
//! Jobs of higher priority go first. Among those of the same priority clients take turns: the first job of each, then the second
//! of each, and so on, where those that run count as first; so nobody waits behind a thousand jobs of somebody else. Jobs of one
//! client keep their order.

use std::collections::{BTreeMap, HashMap};

use crate::job::{ClientName, JobId, Sequence};

/// Jobs of higher priority begin first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Priority(pub i32);

/// A job that waits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Waiting {
    /// Whose it is.
    pub client: ClientName,
    /// Before whom it goes.
    pub priority: Priority,
    /// When it came.
    pub sequence: Sequence,
}

/// What the queue is told.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// A job came.
    Submitted(JobId, Waiting),
    /// A job is not wanted any more.
    Withdrawn(JobId),
    /// A job that ran has left its place.
    Left(JobId),
    /// A job that ran has left its place, and must run again later.
    PutBack(JobId),
    /// Jobs may begin: until then, all wait.
    Opened,
    /// No job may begin any more.
    Closed,
}

/// What is to be done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Begin this job: it has a place until it is said to have left.
    Start(JobId),
    /// Tell this job, which runs, to end.
    Stop(JobId),
}

/// How many jobs run at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Places {
    /// Of all clients.
    pub all: usize,
    /// Of one client.
    pub of_a_client: usize,
}

/// The jobs that wait, and those that run.
#[derive(Debug)]
pub struct Queue {
    places: Places,
    waiting: BTreeMap<JobId, Waiting>,
    running: BTreeMap<JobId, Waiting>,
    closed: bool,
}

impl Queue {
    /// An empty queue.
    #[must_use]
    pub fn new(places: Places) -> Self {
        Self { places, waiting: BTreeMap::new(), running: BTreeMap::new(), closed: false }
    }

    /// Takes notice of what happened. What is to be done now.
    pub fn handle(&mut self, event: Event) -> Vec<Action> {
        match event {
            Event::Submitted(job, waiting) => {
                self.waiting.insert(job, waiting);
            }
            Event::Withdrawn(job) => {
                if self.waiting.remove(&job).is_none() && self.running.contains_key(&job) {
                    // Its place is free when it has left.
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

    /// Jobs that wait.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Jobs that run.
    #[must_use]
    pub fn running(&self) -> usize {
        self.running.len()
    }

    /// The jobs that wait, in the order in which they would begin if all were as long.
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

    /// Gives the free places away.
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
    fn jobs_begin_when_there_is_a_place() {
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
    fn whoever_has_a_job_running_waits_for_those_who_have_none() {
        let mut queue = queue(1, 9);
        for event in [submitted(1, "a", 0), submitted(2, "a", 0), submitted(3, "b", 0)] {
            queue.handle(event);
        }
        assert_eq!(order(&queue), [3, 2]);
    }

    #[test]
    fn a_client_has_no_more_places_than_its_own() {
        let mut queue = queue(3, 1);
        assert_eq!(queue.handle(submitted(1, "a", 0)), [Action::Start(JobId(1))]);
        assert_eq!(queue.handle(submitted(2, "a", 9)), []);
        assert_eq!(queue.handle(submitted(3, "b", 0)), [Action::Start(JobId(3))]);
        assert_eq!(queue.handle(Event::Left(JobId(1))), [Action::Start(JobId(2))]);
    }

    #[test]
    fn a_job_that_is_withdrawn_keeps_its_place_until_it_has_left() {
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
    fn a_job_that_is_put_back_has_its_old_turn() {
        let mut queue = queue(1, 1);
        queue.handle(submitted(1, "a", 0));
        queue.handle(submitted(2, "a", 0));
        assert_eq!(queue.handle(Event::PutBack(JobId(1))), [Action::Start(JobId(1))]);
    }

    #[test]
    fn nothing_begins_after_the_end() {
        let mut queue = queue(1, 1);
        queue.handle(submitted(1, "a", 0));
        queue.handle(submitted(2, "a", 0));
        assert_eq!(queue.handle(Event::Closed), [Action::Stop(JobId(1))]);
        assert_eq!(queue.handle(Event::PutBack(JobId(1))), []);
        assert_eq!(queue.handle(submitted(3, "a", 0)), []);
        assert_eq!(queue.waiting(), 3);
    }
}
