//! How far away workers are, in jobs: a worker holds those that its threads compute while a message and its answer travel.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::scheduler::{WorkerId, room};

/// Weight of the latest time in a mean.
const LATEST: f64 = 0.2;

/// Round trips remembered: the shortest of them is the way, the others waited for something else as well.
const REMEMBERED: usize = 8;

/// The distances of the workers that are connected.
#[derive(Debug, Default)]
pub(super) struct Distances {
    of: BTreeMap<WorkerId, Distance>,
}

#[derive(Debug, Default)]
struct Distance {
    threads: usize,
    /// The latest ones.
    round_trips: Vec<Duration>,
    /// Mean time that a job takes, in seconds, once one was answered.
    job: Option<f64>,
    /// Jobs that it holds beyond what one nearby would.
    ahead: usize,
}

impl Distance {
    /// How many jobs the worker may hold, where that has changed.
    fn changed_room(&mut self) -> Option<usize> {
        let way = self.round_trips.iter().min()?;
        let jobs = room(self.threads, *way, Duration::from_secs_f64(self.job?));
        let ahead = jobs - room(self.threads, Duration::ZERO, Duration::MAX);
        (std::mem::replace(&mut self.ahead, ahead) != ahead).then_some(jobs)
    }
}

impl Distances {
    /// A worker of this many threads is connected.
    pub(super) fn joined(&mut self, worker: WorkerId, threads: usize) {
        self.of.insert(worker, Distance { threads, ..Distance::default() });
    }

    /// A worker is lost.
    pub(super) fn lost(&mut self, worker: WorkerId) {
        self.of.remove(&worker);
    }

    /// A worker computed a job for this long. Returns how many jobs it may hold, where its first job tells that.
    pub(super) fn computed(&mut self, worker: WorkerId, busy: Duration) -> Option<usize> {
        let distance = self.of.get_mut(&worker)?;
        let latest = busy.as_secs_f64();
        let earlier = distance.job.replace(latest);
        if let Some(mean) = earlier {
            distance.job = Some(mean + LATEST * (latest - mean));
            return None;
        }
        distance.changed_room()
    }

    /// A worker answered a message after this time. Returns how many jobs it may hold, where that has changed.
    pub(super) fn answered_after(&mut self, worker: WorkerId, time: Duration) -> Option<usize> {
        let distance = self.of.get_mut(&worker)?;
        if distance.round_trips.len() == REMEMBERED {
            distance.round_trips.remove(0);
        }
        distance.round_trips.push(time);
        distance.changed_room()
    }

    /// Jobs that all workers hold beyond what they would nearby.
    pub(super) fn ahead(&self) -> usize {
        self.of.values().map(|distance| distance.ahead).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_worker_holds_follows_its_distance() {
        let (worker, millis) = (WorkerId(1), Duration::from_millis);
        let mut distances = Distances::default();
        distances.joined(worker, 2);
        assert_eq!(distances.answered_after(worker, millis(200)), None, "nothing is known of its jobs");
        assert_eq!(distances.computed(worker, millis(50)), Some(2 * (2 + 8) + 1));
        assert_eq!(distances.computed(worker, millis(50)), None, "as before");
        assert_eq!(distances.ahead(), 16);
        assert_eq!(distances.answered_after(worker, millis(210)), None, "as before");
        assert_eq!(
            distances.answered_after(worker, millis(40)),
            Some(2 * (2 + 2) + 1),
            "the shortest counts"
        );
        distances.lost(worker);
        assert_eq!((distances.ahead(), distances.answered_after(worker, millis(1))), (0, None));
    }
}
