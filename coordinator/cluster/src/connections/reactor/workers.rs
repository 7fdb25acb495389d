//! What comes from workers.

use std::sync::atomic::Ordering::Relaxed;

use kernel::replica::Digest;
use protocol::worker::FailureReason;

use super::super::answer::Checked;
use super::super::message::Joined;
use super::super::session::{LostWorkerReason, News};
use super::super::summary::Delivery;
use super::{Delivered, Reactor, ReactorObserver};
use crate::scheduler::{Action, Event, PassOutcome, WorkerId};

impl<O: ReactorObserver> Reactor<O> {
    /// A worker came.
    pub(super) fn join(&mut self, Joined { worker, address, hello, peer, commands, bytes_sent }: Joined) {
        let threads = hello.threads as usize;
        tracing::info!(worker = hello.name, address, threads, version = hello.software_version, "connected");
        self.waiting.came(&address);
        self.refusals.joined(worker, hello.largest_replica);
        if self.accounts.open(worker, hello.name, address, threads, bytes_sent) {
            self.settings.metrics.came_back();
        }
        if self.shutdown.is_some() {
            // It came too late: without commands its session ends.
            return;
        }
        self.sessions.insert(worker, commands);
        self.connected.workers.fetch_add(1, Relaxed);
        self.connected.threads.fetch_add(threads, Relaxed);
        self.distances.joined(worker, threads);
        if let Some(peer) = peer {
            self.passing.joined(worker, peer);
            self.on(Event::PassesReplicas { worker });
        }
        self.on(Event::WorkerConnected { worker, threads });
        self.look_round();
    }

    /// A worker says something.
    pub(super) fn hear(&mut self, worker: WorkerId, news: News) {
        match news {
            News::Loaded(digest) => {
                self.refusals.arrived(worker, self.accounts.address(worker), digest);
                self.passing.arrived(worker, digest);
                self.on(Event::ReplicaLoaded { worker, digest });
            }
            News::Passed { digest, to, outcome, message } => {
                if outcome == PassOutcome::Failed {
                    let from = self.accounts.name(worker);
                    tracing::debug!(worker = from, replica = %digest, message, "a replica was not passed on");
                }
                self.on(Event::PassEnded { from: worker, worker: to, digest, outcome });
            }
            News::Refused { digest, message } => self.refuse(worker, digest, message),
            News::Finished(answer) => self.finish(worker, answer),
            News::Failed { job, reason, message } => {
                // There is nothing to compare with any more.
                self.delivered.remove(&job);
                let event = match reason {
                    FailureReason::UnknownReplica => Event::ForgotReplica { worker, job },
                    FailureReason::InvalidJob => Event::Refused { worker, job },
                    FailureReason::Cancelled => Event::Cancelled { worker, job },
                    FailureReason::Internal | FailureReason::Unspecified => {
                        tracing::warn!(worker = self.accounts.name(worker), %job, message, "a job failed");
                        Event::Failed { worker, job }
                    }
                };
                let actions = self.observer.decide(&mut self.scheduler, event);
                self.carry_out(actions, &message);
            }
            News::RoundTrip(time) => {
                if let Some(jobs) = self.distances.answered_after(worker, time) {
                    self.hold(worker, jobs);
                }
            }
            News::Lost(reason) => self.lose(worker, &reason),
        }
    }

    /// A worker may hold this many jobs.
    fn hold(&mut self, worker: WorkerId, jobs: usize) {
        self.connected.ahead.store(self.distances.ahead(), Relaxed);
        self.on(Event::RoomChanged { worker, jobs });
    }

    /// A worker is gone.
    fn lose(&mut self, worker: WorkerId, reason: &LostWorkerReason) {
        if self.sessions.remove(&worker).is_some() {
            self.connected.workers.fetch_sub(1, Relaxed);
            self.connected.threads.fetch_sub(self.accounts.threads(worker), Relaxed);
        }
        self.distances.lost(worker);
        self.connected.ahead.store(self.distances.ahead(), Relaxed);
        self.delivered.retain(|_, delivered| delivered.holder != worker);
        self.refusals.lost(worker, self.accounts.address(worker), reason.is_orderly());
        self.passing.lost(worker);
        if self.shutdown.is_some() {
            self.accounts.close(worker);
            return;
        }
        self.settings.metrics.lost(reason.is_orderly());
        let (name, address) = self.accounts.lose(worker, reason.to_string(), reason.is_orderly());
        if reason.is_fault() {
            let again = match self.settings.forgives {
                Some(pause) => format!("it is asked again in {} s", pause.as_secs()),
                None => "it is not asked again".into(),
            };
            tracing::warn!(worker = name, address, %reason, "lost a worker: {again}");
        } else {
            tracing::warn!(worker = name, address, %reason, "lost a worker");
        }
        if self.sessions.is_empty() && self.waiting.is_alone() {
            tracing::warn!(seconds = self.settings.grace.as_secs_f64(), "no worker is left: waiting for one");
        }
        let event = Event::WorkerLost { worker, orderly: reason.is_orderly() };
        let actions = self.observer.decide(&mut self.scheduler, event);
        self.carry_out(actions, &format!("worker {name} was lost: {reason}"));
        self.look_round();
    }

    /// A worker does not take a replica: others may.
    pub(super) fn refuse(&mut self, worker: WorkerId, digest: Digest, message: String) {
        tracing::warn!(worker = self.accounts.name(worker), message, "a worker does not take a replica");
        self.refusals.refused(worker, digest, message);
        self.on(Event::ReplicaRefused { worker, digest });
    }

    /// A worker answers a job.
    fn finish(&mut self, worker: WorkerId, Checked { work, digest, bytes }: Checked) {
        let job = work.job();
        if let Some(jobs) = self.distances.computed(worker, work.busy()) {
            self.hold(worker, jobs);
        }
        let actions = self.observer.decide(&mut self.scheduler, Event::Finished { worker, job });
        let is_first = actions.contains(&Action::Deliver { job });
        self.accounts.count(worker, is_first, &work, bytes);
        self.connected.ledger.computed(work.busy());
        self.settings.metrics.answered(is_first, work.rows(), work.rays(), work.busy(), bytes);
        if is_first {
            let holder = actions.iter().find_map(|action| match action {
                Action::Cancel { worker, job: cancelled } if *cancelled == job => Some(*worker),
                _ => None,
            });
            if let Some(holder) = holder {
                self.delivered.insert(job, Delivered { digest, by: worker, holder });
            }
            self.requests.remove(&job);
            let by = self.accounts.who(worker);
            self.report(Ok(Delivery { work, by, bytes }));
        } else if let Some(first) = self.delivered.remove(&job) {
            self.accounts.count_late(worker);
            if first.digest != digest {
                tracing::error!(
                    %job,
                    first = self.accounts.name(first.by),
                    second = self.accounts.name(worker),
                    "two workers gave different answers to the same job: one of them is broken, and the output is in doubt"
                );
            }
        }
        self.carry_out(actions, "");
    }
}
