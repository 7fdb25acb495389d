//! Where the time of the workers went.

use std::collections::BTreeMap;

use bake::Phase;

use crate::processor::Nanoseconds;

/// What an idle thread waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// The driver computes, and asks for nothing meanwhile.
    Coordinator,
    /// A replica is on its way to it, or made ready there.
    Replica,
    /// A job is on its way to it, or all answers are on their way home.
    Network,
    /// Fewer jobs are under way than there are threads: the window, or the end of a batch.
    TooFewJobs,
}

/// Sums over a bake.
pub struct Account {
    workers: usize,
    /// Up to where it is known.
    time: Nanoseconds,
    /// Thread time idle.
    pub idle: BTreeMap<(&'static str, Cause), Nanoseconds>,
    /// Time that passed.
    pub elapsed: BTreeMap<&'static str, Nanoseconds>,
    /// Processor time of the driver.
    pub driver: BTreeMap<&'static str, Nanoseconds>,
    /// Processor time of the driver that several threads can share: part of the former.
    pub shared: Nanoseconds,
    /// Processor time of the scheduler.
    pub scheduling: Nanoseconds,
    /// Events that it was told.
    pub events: u64,
    /// Processor time of decoding.
    pub decoding: Nanoseconds,
    /// Time that all jobs take on one worker.
    pub compute: Nanoseconds,
    /// Jobs asked for.
    pub jobs: u64,
    /// Length of the answers.
    pub bytes: u64,
    /// Copies sent, and answers dropped.
    pub duplicates: [u64; 2],
}

impl Account {
    /// Nothing yet.
    #[must_use]
    pub fn new(workers: usize) -> Self {
        Self {
            workers,
            time: 0,
            idle: BTreeMap::new(),
            elapsed: BTreeMap::new(),
            driver: BTreeMap::new(),
            shared: 0,
            scheduling: 0,
            events: 0,
            decoding: 0,
            compute: 0,
            jobs: 0,
            bytes: 0,
            duplicates: [0; 2],
        }
    }

    /// A job was asked for.
    pub fn asked(&mut self, compute: Nanoseconds, bytes: u64) {
        self.compute += compute;
        self.jobs += 1;
        self.bytes += bytes;
    }

    /// Up to `time` so many threads waited. The driver worked up to `driver`.
    pub fn wait(
        &mut self,
        time: Nanoseconds,
        driver: Nanoseconds,
        phase: Phase,
        waiting: &BTreeMap<Cause, usize>,
    ) {
        let phase = phase.name();
        let passed = time.saturating_sub(self.time);
        let alone = driver.clamp(self.time, self.time + passed) - self.time;
        for (cause, threads) in waiting {
            let threads = *threads as u64;
            *self.idle.entry((phase, Cause::Coordinator)).or_default() += threads * alone;
            *self.idle.entry((phase, *cause)).or_default() += threads * (passed - alone);
        }
        *self.elapsed.entry(phase).or_default() += passed;
        self.time = self.time.max(time);
    }

    /// Up to `time` nobody had anything to do.
    pub fn advance(&mut self, time: Nanoseconds, driver: Nanoseconds, phase: Phase) {
        let all = BTreeMap::from([(Cause::Coordinator, self.workers)]);
        self.wait(time, driver, phase, &all);
    }
}
