//! Membership: follows the names of the workers, dials them, works with those that answer, and dials again after a loss.

use std::collections::{HashMap, HashSet};
use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use protocol::security::ClientSecurity;
use tokio::sync::{mpsc, oneshot, watch};
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};
use tokio_util::sync::CancellationToken;

use super::backoff::Backoff;
use super::connect::{self, CONNECT_TIMEOUT, Connection, EMBEDDED, place};
use super::error::ClusterError;
use super::message::{Joined, Message};
use super::session::{self, News, SessionMetrics};
use super::settings::ClusterSettings;
use crate::metrics::Metrics;
use crate::scheduler::WorkerId;
use protocol::network::Network;

/// Interval between look-ups of a name: a new machine is found within it.
const LOOK_UP_INTERVAL: Duration = Duration::from_secs(2);

/// Delay before another address of a connected worker is tried again.
const ALIAS_DELAY: Duration = Duration::from_secs(60);

/// State that the tasks of all members share.
pub(super) struct Members {
    network: Arc<dyn Network>,
    security: ClientSecurity,
    forgives: Option<Duration>,
    metrics: Metrics,
    reactor: mpsc::UnboundedSender<Message>,
    next: AtomicU32,
    /// Instances of connected workers, by whatever address.
    instances: Mutex<HashSet<u64>>,
    /// Told whenever a worker says hello: where a network heals, others may answer, too.
    answered: watch::Sender<()>,
    /// Cancelled when the cluster ends; embedded workers end with it.
    leaving: CancellationToken,
}

impl Members {
    pub(super) fn new(
        network: Arc<dyn Network>,
        settings: &ClusterSettings,
        reactor: mpsc::UnboundedSender<Message>,
        leaving: CancellationToken,
    ) -> Arc<Self> {
        let instances = Mutex::new(HashSet::new());
        Arc::new(Self {
            network,
            security: settings.security.clone(),
            forgives: settings.forgives,
            metrics: settings.metrics.clone(),
            reactor,
            next: AtomicU32::new(0),
            instances,
            answered: watch::Sender::new(()),
            leaving,
        })
    }

    /// Ends all dialling.
    pub(super) fn leave(&self) {
        self.leaving.cancel();
    }

    /// Starts a worker in this process and works with it.
    pub(super) fn embed(self: &Arc<Self>, threads: NonZeroUsize) {
        let members = Arc::clone(self);
        tokio::spawn(async move {
            match connect::embed(threads, members.leaving.clone()).await {
                Ok(connection) => {
                    members.tell(Message::Tried { name: EMBEDDED.into() });
                    members.work(connection, None).await;
                }
                Err(error) => {
                    members.tell(Message::Failed { place: EMBEDDED.into(), error });
                    members.tell(Message::Tried { name: EMBEDDED.into() });
                }
            }
            members.tell(Message::GaveUp);
        });
    }

    /// Looks after all machines behind a name, now and later.
    pub(super) fn follow(self: &Arc<Self>, name: String) {
        let members = Arc::clone(self);
        tokio::spawn(async move {
            let leaving = members.leaving.clone();
            tokio::select! {
                () = leaving.cancelled() => {}
                () = members.follow_until_cancelled(&name) => {}
            }
        });
    }

    async fn follow_until_cancelled(self: &Arc<Self>, name: &str) {
        let mut keepers: HashMap<SocketAddr, Keeper> = HashMap::new();
        let mut tried = Some(name.to_owned());
        loop {
            let mut new = vec![];
            match timeout(CONNECT_TIMEOUT, self.network.resolve(name)).await {
                Ok(Ok(sockets)) => {
                    // A machine that is not listed any more may finish its session, but is not dialled again.
                    keepers.retain(|socket, keeper| {
                        sockets.contains(socket) || {
                            keeper.listed.cancel();
                            false
                        }
                    });
                    for socket in sockets {
                        keepers.entry(socket).or_insert_with(|| {
                            let (keeper, first_try) = self.keep(name, socket);
                            new.push(first_try);
                            keeper
                        });
                    }
                    if keepers.is_empty() {
                        self.fail(name, "the name has no address");
                    }
                }
                Ok(Err(error)) => self.fail(name, &error.to_string()),
                Err(_) => self.fail(name, "the name server does not answer"),
            }
            if let Some(name) = tried.take() {
                let members = Arc::clone(self);
                // A machine that does not answer delays no look-up.
                tokio::spawn(async move {
                    for first_try in new {
                        // Its end alone says that it was tried.
                        let _ = first_try.await;
                    }
                    members.tell(Message::Tried { name });
                });
            }
            // An address never stands for another machine: once it is given up there is nothing left to do.
            if name.parse::<SocketAddr>().is_ok() {
                for keeper in keepers.into_values() {
                    let _ = keeper.task.await;
                }
                self.tell(Message::GaveUp);
                return;
            }
            sleep(LOOK_UP_INTERVAL).await;
        }
    }

    fn fail(&self, name: &str, reason: &str) {
        let error = ClusterError::Unreachable { address: name.into(), reason: reason.into() };
        self.tell(Message::Failed { place: name.into(), error });
    }

    /// Starts to look after one machine. The receiver ends after the first dial.
    fn keep(self: &Arc<Self>, name: &str, socket: SocketAddr) -> (Keeper, oneshot::Receiver<()>) {
        let (trying, first_try) = oneshot::channel();
        let listed = self.leaving.child_token();
        let (members, name, still_listed) = (Arc::clone(self), name.to_owned(), listed.clone());
        let task = tokio::spawn(async move { members.look_after(&name, socket, still_listed, trying).await });
        (Keeper { listed, task }, first_try)
    }

    /// Dials, works, and dials again, until the machine is not listed any more, or at fault and not forgiven.
    async fn look_after(
        &self,
        name: &str,
        socket: SocketAddr,
        listed: CancellationToken,
        first_try: oneshot::Sender<()>,
    ) {
        let mut first_try = Some(first_try);
        let mut backoff = Backoff::default();
        let mut answered = self.answered.subscribe();
        loop {
            answered.borrow_and_update();
            let dialled = tokio::select! {
                () = listed.cancelled() => return,
                dialled = connect::dial(&self.network, &self.security, name, socket) => dialled,
            };
            let (wait, is_away) = match dialled {
                Ok(connection) => match self.work(connection, first_try.take()).await {
                    Parted::AtFault => match self.forgives {
                        Some(pause) => (pause, false),
                        None => return,
                    },
                    Parted::KnownAlready => (ALIAS_DELAY, false),
                    Parted::Lost { useful } => (backoff.lost(useful), false),
                },
                Err(error) => {
                    let is_final = error.is_final();
                    self.tell(Message::Failed { place: place(name, socket), error });
                    match (is_final, self.forgives) {
                        (false, _) => (backoff.not_reached(), true),
                        (true, Some(pause)) => (pause, false),
                        (true, None) => return,
                    }
                }
            };
            first_try = None;
            tokio::select! {
                () = listed.cancelled() => return,
                () = sleep(wait) => {}
                // Its sender is held.
                Ok(()) = answered.changed(), if is_away => {}
            }
        }
    }

    /// Works with a worker until it is lost. This is the only place from which a loss is told.
    async fn work(&self, connection: Connection, joined: Option<oneshot::Sender<()>>) -> Parted {
        let Some(_claim) = self.claim(connection.hello.instance) else { return Parted::KnownAlready };
        let worker = WorkerId(self.next.fetch_add(1, Ordering::Relaxed));
        let (commands, inbox) = mpsc::unbounded_channel();
        let bytes_sent = Arc::new(AtomicU64::new(0));
        self.tell(Message::Joined(Joined {
            worker,
            address: connection.address.clone(),
            hello: connection.hello.clone(),
            peer: connection.peer.clone(),
            commands,
            bytes_sent: Arc::clone(&bytes_sent),
        }));
        drop(joined);
        self.answered.send_replace(());
        let useful = AtomicBool::new(false);
        let tell = |news| self.tell(Message::News(worker, news));
        let threads = connection.hello.threads as usize;
        let own = self.metrics.connected(&connection.hello.name, &connection.address, threads);
        let metrics = SessionMetrics { all: self.metrics.clone(), own };
        let reason = session::run(connection, inbox, bytes_sent, metrics, |news| {
            useful.fetch_or(matches!(news, News::Finished(_)), Ordering::Relaxed);
            tell(news);
        });
        let reason = reason.await;
        let parted = if reason.is_fault() {
            Parted::AtFault
        } else {
            Parted::Lost { useful: useful.load(Ordering::Relaxed) }
        };
        tell(News::Lost(reason));
        parted
    }

    fn claim(&self, instance: u64) -> Option<Claim<'_>> {
        let is_new = self.instances.lock().unwrap_or_else(PoisonError::into_inner).insert(instance);
        is_new.then_some(Claim { members: self, instance })
    }

    fn tell(&self, message: Message) {
        // The reactor ends before its members only when the whole cluster does.
        let _ = self.reactor.send(message);
    }
}

/// How work with a machine ended.
enum Parted {
    /// It may come back. `useful` if it had answered any job.
    Lost { useful: bool },
    /// It is not dialled again.
    AtFault,
    /// The worker is connected by another address.
    KnownAlready,
}

/// A task that looks after one machine.
struct Keeper {
    listed: CancellationToken,
    task: JoinHandle<()>,
}

/// Marks a worker as connected until it is dropped.
struct Claim<'a> {
    members: &'a Members,
    instance: u64,
}

impl Drop for Claim<'_> {
    fn drop(&mut self) {
        self.members.instances.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.instance);
    }
}
