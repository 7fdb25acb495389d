//! Starts the reactor and dials the workers.

use std::num::NonZeroUsize;
use std::sync::Arc;

use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::{CancellationToken, DropGuard};

use super::connect::check_name;
use super::error::ClusterError;
use super::members::Members;
use super::message::Message;
use super::reactor::{self, Connected, Reactor, ReactorObserver};
use super::settings::{ClusterSettings, Workers};
use protocol::network::Network;

/// The reactor's task, as seen by its owner.
pub(super) struct Started {
    /// Orders for the reactor.
    pub(super) messages: mpsc::UnboundedSender<Message>,
    /// Results of jobs.
    pub(super) results: mpsc::UnboundedReceiver<reactor::Result>,
    /// The workers that are connected.
    pub(super) connected: Arc<Connected>,
    /// Told once there is a worker and the others had a moment to answer, or why there is none.
    pub(super) is_ready: oneshot::Receiver<Result<(), ClusterError>>,
    /// Ends the embedded worker, and all dialling.
    pub(super) leaving: DropGuard,
}

impl Started {
    /// Starts it on the runtime of the caller.
    ///
    /// # Errors
    /// When there is no worker to dial or to start, or an address is malformed.
    pub(super) fn new(
        settings: &ClusterSettings,
        network: Arc<dyn Network>,
        observer: impl ReactorObserver,
    ) -> Result<Self, ClusterError> {
        let (messages, inbox) = mpsc::unbounded_channel();
        let (sender, results) = mpsc::unbounded_channel();
        let (ready, is_ready) = oneshot::channel();
        let leaving = CancellationToken::new();
        let guard = leaving.clone().drop_guard();
        let members = Members::new(network, settings, messages.clone(), leaving.clone());
        let names = match &settings.workers {
            Workers::Embedded { threads } => {
                members.embed(NonZeroUsize::new(*threads).ok_or(ClusterError::NoWorkers)?);
                1
            }
            Workers::Remote(names) if names.is_empty() => return Err(ClusterError::NoWorkers),
            Workers::Remote(names) => {
                names.iter().try_for_each(|name| check_name(name))?;
                names.iter().for_each(|name| members.follow(name.clone()));
                names.len()
            }
        };
        let connected: Arc<Connected> = Arc::default();
        let seen = Arc::clone(&connected);
        let reactor = Reactor::new(observer, settings.clone(), members, names, sender, seen, ready);
        tokio::spawn(reactor.run(inbox, leaving));
        Ok(Self { messages, results, connected, is_ready, leaving: guard })
    }
}
