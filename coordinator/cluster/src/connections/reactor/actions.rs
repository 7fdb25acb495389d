//! What the scheduler decides.

use std::sync::Arc;

use kernel::replica::Digest;

use super::super::error::ClusterError;
use super::super::session::Command;
use super::{Reactor, ReactorObserver, Result};
use crate::scheduler::{Abandonment, Action, Event, WorkerId};

impl<O: ReactorObserver> Reactor<O> {
    /// Has the scheduler decide.
    pub(super) fn on(&mut self, event: Event) {
        let actions = self.observer.decide(&mut self.scheduler, event);
        self.carry_out(actions, "");
    }

    /// Carries out actions. `message` is the worker's, about a job that failed.
    pub(super) fn carry_out(&mut self, actions: Vec<Action>, message: &str) {
        let mut refused = vec![];
        for action in actions {
            match action {
                Action::LoadReplica { worker, digest } => {
                    refused.extend(self.load(worker, digest, None));
                }
                Action::PassReplica { from, worker, digest } => {
                    refused.extend(self.load(worker, digest, Some(from)));
                }
                Action::ReleaseReplica { worker, digest } => self.command(worker, Command::Release(digest)),
                Action::Send { worker, job } => {
                    if let Some(request) = self.requests.get(&job) {
                        self.command(worker, Command::Job(job, Arc::clone(request)));
                    }
                }
                Action::Cancel { worker, job } => self.command(worker, Command::Cancel(job)),
                // Done where the answer is.
                Action::Deliver { .. } => {}
                Action::Abandon { job, why } => {
                    let request = self.requests.remove(&job);
                    let message = match (why, request) {
                        (Abandonment::ReplicaRefused, Some(request)) => {
                            self.refusals.reason(&request.needs())
                        }
                        _ => message.into(),
                    };
                    self.report(Err(ClusterError::Abandoned { job, why, message }));
                }
            }
        }
        for (worker, digest, message) in refused {
            self.refuse(worker, digest, message);
        }
    }

    /// Has a replica loaded to a worker, by another one or from here. Returns why it is not to be, if so.
    fn load(
        &mut self,
        worker: WorkerId,
        digest: Digest,
        from: Option<WorkerId>,
    ) -> Option<(WorkerId, Digest, String)> {
        let Some(replica) = self.replicas.get(&digest).map(Arc::clone) else {
            self.report(Err(ClusterError::NotPublished(digest)));
            return None;
        };
        let place = (self.accounts.name(worker), self.accounts.address(worker));
        if let Err(message) = self.refusals.sends(worker, place, &replica.replica) {
            return Some((worker, digest, message));
        }
        self.passing.begins(worker, digest, replica.replica.bytes.len() as u64);
        match from.zip(self.passing.peer(worker)) {
            Some((from, peer)) => {
                let peer = peer.clone();
                self.command(from, Command::Pass { digest, to: worker, peer });
            }
            None => self.command(worker, Command::Load(replica)),
        }
        None
    }

    /// Sends a session a command.
    pub(super) fn command(&self, worker: WorkerId, command: Command) {
        if let Some(session) = self.sessions.get(&worker) {
            // A session that is over has told so, and its jobs come back with that news.
            let _ = session.send(command);
        }
    }

    /// Sends the caller a result.
    pub(super) fn report(&self, result: Result) {
        // A caller that left needs no results.
        let _ = self.results.send(result);
    }
}
