use std::time::Duration;

use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

/// All faults are over at this time.
pub const CALM: Duration = Duration::from_secs(15);

/// A fault of a worker, or its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// Its process ends at once: its connections break.
    Crash,
    /// Its machine is gone: nothing comes from it any more, not even the end of its connections.
    PowerCut,
    /// It is told to stop, and leaves the name server's list.
    Drain,
    /// It starts again, with nothing in it.
    Restart,
    /// No message gets through, to it or from it.
    Partition,
    /// Messages get through again; those sent meanwhile are lost.
    Repair,
    /// It is held: messages wait, and come all at once.
    Hold,
    /// It goes on.
    Release,
    /// Its messages take longer.
    Slow,
    /// They do not any more.
    Quick,
}

/// A worker.
#[derive(Debug, Clone, Copy)]
pub struct WorkerPlan {
    pub threads: usize,
    /// Time for a job.
    pub time: Duration,
    /// When it starts for the first time.
    pub joins: Duration,
}

/// A simulation.
#[derive(Debug, Clone)]
pub struct Plan {
    pub workers: Vec<WorkerPlan>,
    /// When, to which worker, and what; in the order of time.
    pub faults: Vec<(Duration, usize, Fault)>,
    /// Longest way of a message.
    pub latency: Duration,
    /// Whether one name stands for all workers, or each has its own.
    pub one_name: bool,
    /// Whether jobs are sent when a timer rings.
    pub periodic: bool,
    /// Whether workers reach each other.
    pub peers: Peers,
}

/// Whether workers reach each other, to pass replicas on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Peers {
    /// They do.
    Together,
    /// A firewall is between them.
    Apart,
    /// What they send each other waits until faults are over.
    Held,
}

impl Plan {
    pub fn new(seed: u64) -> Self {
        let mut rng = SmallRng::seed_from_u64(seed);
        let mut between = |least: u64, most: u64| rng.random_range(least..=most);
        let mut workers: Vec<WorkerPlan> = (0..between(2, 5))
            .map(|_| WorkerPlan {
                threads: between(1, 3) as usize,
                time: Duration::from_millis(between(50, 900)),
                joins: Duration::from_millis(if between(0, 2) == 0 { between(500, 9000) } else { 0 }),
            })
            .collect();
        workers[0].joins = Duration::ZERO;
        let mut faults = vec![];
        for (index, worker) in workers.iter().enumerate() {
            let mut time = worker.joins + Duration::from_millis(between(100, 4000));
            while time < CALM {
                let [begin, end] = [
                    [Fault::Crash, Fault::Restart],
                    [Fault::PowerCut, Fault::Restart],
                    [Fault::Drain, Fault::Restart],
                    [Fault::Partition, Fault::Repair],
                    [Fault::Hold, Fault::Release],
                    [Fault::Slow, Fault::Quick],
                ][between(0, 5) as usize];
                // Short ones come before anybody notices.
                let length = if between(0, 1) == 0 { between(20, 800) } else { between(800, 7000) };
                let over = (time + Duration::from_millis(length)).min(CALM);
                faults.extend([(time, index, begin), (over, index, end)]);
                time = over + Duration::from_millis(between(100, 4000));
            }
        }
        // Stable: what begins and ends at the same time stays in this order.
        faults.sort_by_key(|(time, ..)| *time);
        Self {
            workers,
            faults,
            latency: Duration::from_millis(between(1, 80)),
            one_name: between(0, 1) == 0,
            periodic: between(0, 4) == 0,
            peers: [Peers::Together, Peers::Together, Peers::Apart, Peers::Held][between(0, 3) as usize],
        }
    }
}
