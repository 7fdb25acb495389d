//! Workers over memory, on a clock that moves only while everything waits: times are exact, however busy the machine is.

use std::collections::HashMap;
use std::io;
use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use cluster::{AsyncCluster, ClusterSettings, JobId, WorkerSummary, Workers};
use glam::DVec3;
use kernel::geometry::PlaneId;
use kernel::replica::{EncodedReplica, Receiver, Receivers, encode_receivers};
use kernel::row::RowRequest;
use protocol::network::{Answer, ByteStream, Network};
use protocol::security::Transport;
use protocol::server::unwatched;
use protocol::worker::worker_server::WorkerServer;
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream, copy, copy_bidirectional, duplex, split};
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep};
use tokio_stream::wrappers::UnboundedReceiverStream;
use tokio_util::sync::{CancellationToken, DropGuard};
use tonic::transport::Server;
use worker::Settings;
use worker::pool::Compute;

use super::bakery::Bakery;
use super::server::Fake;

/// Bytes that a connection holds.
const BUFFER: usize = 1 << 16;

/// Longer than anything here takes by this clock.
pub const LONG: Duration = Duration::from_secs(300);

/// Time for a job.
pub const SOON: Duration = Duration::from_millis(10);

/// What becomes of a connection to an address; given the place among those to it, from 0.
pub type Door = Arc<dyn Fn(usize) -> Answer<Box<dyn ByteStream>> + Send + Sync>;

/// A network of addresses that answer as a test tells them.
#[derive(Default)]
pub struct Wires {
    doors: Mutex<HashMap<SocketAddr, (Door, Arc<AtomicUsize>)>>,
}

impl Wires {
    pub fn set(&self, address: &str, door: Door) {
        self.doors.lock().unwrap().insert(address.parse().unwrap(), (door, Arc::default()));
    }
}

impl Network for Wires {
    fn resolve(&self, name: &str) -> Answer<Vec<SocketAddr>> {
        let address = name.parse().unwrap();
        Box::pin(async move { Ok(vec![address]) })
    }

    fn connect(&self, address: SocketAddr) -> Answer<Box<dyn ByteStream>> {
        let (door, before) = self.doors.lock().unwrap()[&address].clone();
        door(before.fetch_add(1, Ordering::Relaxed))
    }
}

fn open(stream: DuplexStream) -> Answer<Box<dyn ByteStream>> {
    Box::pin(async move { Ok(Box::new(stream) as Box<dyn ByteStream>) })
}

/// Nobody answers, not even with a refusal.
pub fn hangs() -> Door {
    Arc::new(|_| Box::pin(std::future::pending()))
}

/// Nobody listens.
pub fn refuses() -> Door {
    Arc::new(|_| Box::pin(async { Err(io::ErrorKind::ConnectionRefused.into()) }))
}

/// A worker that ends when this is dropped.
pub struct Process {
    connections: mpsc::UnboundedSender<io::Result<DuplexStream>>,
    _stops: DropGuard,
}

impl Process {
    /// A fake one.
    pub fn fake(fake: Fake) -> Self {
        let (connections, accepted) = mpsc::unbounded_channel();
        let stop = CancellationToken::new();
        let guard = stop.clone().drop_guard();
        let serving = Server::builder()
            .add_service(WorkerServer::new(fake))
            .serve_with_incoming_shutdown(UnboundedReceiverStream::new(accepted), stop.cancelled_owned());
        tokio::spawn(serving);
        Self { connections, _stops: guard }
    }

    /// One that takes so long for each piece of work.
    pub fn start(time: Duration) -> Self {
        let defaults = Settings::new("real", NonZeroUsize::MIN);
        Self::with(Settings { compute: Compute::InTask { time }, ..defaults })
    }

    /// One with these settings.
    pub fn with(settings: Settings) -> Self {
        let (connections, accepted) = mpsc::unbounded_channel();
        let stop = CancellationToken::new();
        let guard = stop.clone().drop_guard();
        tokio::spawn(worker::serve(unwatched(UnboundedReceiverStream::new(accepted)), settings, stop));
        Self { connections, _stops: guard }
    }

    /// Has it run to the end of the test.
    pub fn leak(self) -> &'static Self {
        Box::leak(Box::new(self))
    }

    /// The way to it, with something done to the far end of each connection.
    pub fn door(
        &self,
        way: impl Fn(usize, DuplexStream) -> Option<DuplexStream> + Send + Sync + 'static,
    ) -> Door {
        let connections = self.connections.clone();
        Arc::new(move |number| {
            let (near, far) = duplex(BUFFER);
            if let Some(far) = way(number, far) {
                // Where it has ended, the caller finds a closed connection.
                let _ = connections.send(Ok(far));
            }
            open(near)
        })
    }

    pub fn plain_door(&self) -> Door {
        self.door(|_, far| Some(far))
    }
}

/// A connection that stays, but takes nothing more towards the worker after `bytes`.
fn held_after(bytes: usize, far: DuplexStream) -> DuplexStream {
    let (theirs, served) = duplex(BUFFER);
    let (from_caller, mut to_caller) = split(far);
    let (mut from_worker, mut to_worker) = split(theirs);
    tokio::spawn(async move {
        let mut from_caller = from_caller.take(bytes as u64);
        let back = copy(&mut from_worker, &mut to_caller);
        tokio::join!(copy(&mut from_caller, &mut to_worker), back, std::future::pending::<()>())
    });
    served
}

/// A link towards the worker that carries this number of bytes per second.
fn throttled(far: DuplexStream, bytes_per_second: usize) -> DuplexStream {
    let (mut theirs, served) = duplex(BUFFER);
    let mut far = far;
    tokio::spawn(async move {
        let (mut from_worker, mut to_worker) = (vec![0; BUFFER], vec![0; bytes_per_second / 100]);
        loop {
            tokio::select! {
                Ok(length @ 1..) = far.read(&mut to_worker) => {
                    if theirs.write_all(&to_worker[..length]).await.is_err() { return; }
                    sleep(Duration::from_secs_f64(length as f64 / bytes_per_second as f64)).await;
                }
                Ok(length @ 1..) = theirs.read(&mut from_worker) => {
                    if far.write_all(&from_worker[..length]).await.is_err() { return; }
                }
                else => return,
            }
        }
    });
    served
}

/// A connection that breaks after so long.
pub fn cut_after(time: Duration, mut far: DuplexStream) -> DuplexStream {
    let (mut theirs, served) = duplex(BUFFER);
    tokio::spawn(async move { tokio::time::timeout(time, copy_bidirectional(&mut far, &mut theirs)).await });
    served
}

pub const A: &str = "10.0.0.1:7070";
pub const B: &str = "10.0.0.2:7070";
pub const C: &str = "10.0.0.3:7070";

pub async fn start(wires: &Arc<Wires>, addresses: &[&str]) -> AsyncCluster {
    let addresses = addresses.iter().map(ToString::to_string).collect();
    let mut settings = ClusterSettings::from(Workers::Remote(addresses));
    settings.grace = LONG;
    settings.forgives = Some(ClusterSettings::FORGIVES);
    settings.security.transport = Transport::Plain { anywhere: true };
    AsyncCluster::start(&settings, Arc::<Wires>::clone(wires)).await.unwrap()
}

/// Waits until the worker at an address is as wanted, and returns its summary.
pub async fn until(
    cluster: &AsyncCluster,
    address: &str,
    is_so: impl Fn(&WorkerSummary) -> bool,
) -> WorkerSummary {
    let waiting = async {
        loop {
            let (workers, _) = cluster.summarise().await;
            let found = workers.into_iter().find(|worker| worker.part.address == address && is_so(worker));
            if let Some(worker) = found {
                return worker;
            }
            sleep(Duration::from_millis(10)).await;
        }
    };
    tokio::time::timeout(LONG, waiting).await.expect("it comes to pass")
}

pub fn is_there(worker: &WorkerSummary) -> bool {
    worker.lost.is_none()
}

/// Publishes the replicas of the bakery and asks for all of its rows. Returns their number.
fn submit(cluster: &AsyncCluster, bakery: &Bakery) -> usize {
    bakery.replicas().into_iter().for_each(|replica| cluster.publish(replica));
    let requests = bakery.requests();
    let count = requests.len();
    cluster.submit((0..).map(JobId).zip(requests).collect());
    count
}

/// A replica of some megabytes, which packing makes no shorter.
pub fn large_replica(receivers: usize) -> EncodedReplica {
    let somewhere = |x: usize| DVec3::new(1.1, 1.3, 1.7).map(|step| (step * x as f64).sin());
    let receiver = |x: usize| Receiver {
        position: somewhere(x),
        normal: somewhere(receivers + x).normalize(),
        plane: PlaneId(0),
    };
    encode_receivers(&Receivers { first_key: 0, receivers: (0..receivers).map(receiver).collect() })
}

#[tokio::test(start_paused = true)]
async fn an_address_that_hangs_does_not_hold_up_the_start() {
    let wires = Arc::new(Wires::default());
    let worker = Process::start(SOON);
    wires.set(A, worker.plain_door());
    wires.set(B, hangs());
    let began = Instant::now();
    let mut cluster = start(&wires, &[A, B]).await;
    let took = began.elapsed();
    assert!(took <= Duration::from_millis(500), "{took:?}");
    for _ in 0..submit(&cluster, &Bakery::new()) {
        cluster.next().await.unwrap();
    }
}

#[tokio::test(start_paused = true)]
async fn an_upload_that_stalls_is_found_as_soon_as_silence() {
    for bytes in [0, 300_000] {
        find_stall(bytes).await;
    }
}

/// An upload after `bytes` of which nothing more is read, while the session goes on.
async fn find_stall(bytes: usize) {
    let wires = Arc::new(Wires::default());
    let worker = Process::start(SOON);
    // The session comes first; the connection after it is that of the uploads.
    wires.set(
        A,
        worker.door(move |number, far| match number {
            1 => Some(held_after(bytes, far)),
            _ => Some(far),
        }),
    );
    let mut cluster = start(&wires, &[A]).await;
    let bakery = Bakery::new();
    let large = large_replica(40_000);
    let request = RowRequest { receivers: large.digest, ..bakery.requests()[0].clone() };
    bakery.replicas().into_iter().chain([large]).for_each(|replica| cluster.publish(replica));
    cluster.submit(vec![(JobId(0), request)]);
    let began = Instant::now();
    let lost = until(&cluster, A, |worker| worker.lost.is_some()).await.lost.unwrap();
    let took = began.elapsed();
    assert!(lost.contains("upload"), "{lost}");
    assert!(took <= Duration::from_millis(4500), "{took:?}: {lost}");
    cluster.next().await.unwrap();
}

/// What is slow gets on: neither a slow link nor a large replica that takes long to be made ready is a stall.
#[tokio::test(start_paused = true)]
async fn a_slow_upload_is_waited_for() {
    let wires = Arc::new(Wires::default());
    let worker = Process::start(Duration::from_secs(9));
    wires.set(
        A,
        worker.door(|number, far| match number {
            1 => Some(throttled(far, 100_000)),
            _ => Some(far),
        }),
    );
    let mut cluster = start(&wires, &[A]).await;
    let bakery = Bakery::new();
    let large = large_replica(40_000);
    assert!(large.bytes.len() > 1_500_000, "{}", large.bytes.len());
    let request = RowRequest { receivers: large.digest, ..bakery.requests()[0].clone() };
    bakery.replicas().into_iter().chain([large]).for_each(|replica| cluster.publish(replica));
    let began = Instant::now();
    cluster.submit(vec![(JobId(0), request)]);
    cluster.next().await.unwrap();
    assert!(began.elapsed() > Duration::from_secs(20), "{:?}", began.elapsed());
    assert_eq!(until(&cluster, A, is_there).await.connections, 1);
}

#[tokio::test(start_paused = true)]
async fn a_worker_that_was_away_for_long_is_found_within_two_seconds() {
    let wires = Arc::new(Wires::default());
    let [here, late] = [(); 2].map(|()| Process::start(SOON));
    wires.set(A, here.plain_door());
    wires.set(B, refuses());
    let cluster = start(&wires, &[A, B]).await;
    sleep(Duration::from_millis(62_600)).await;
    wires.set(B, late.plain_door());
    let began = Instant::now();
    until(&cluster, B, is_there).await;
    assert!(began.elapsed() <= Duration::from_millis(2050), "{:?}", began.elapsed());
}

/// Where a network heals, the first worker that answers tells that others may, too.
#[tokio::test(start_paused = true)]
async fn one_that_answers_has_the_others_dialled_at_once() {
    let wires = Arc::new(Wires::default());
    let [here, leaves] = [(); 2].map(|()| Process::start(SOON));
    wires.set(A, here.plain_door());
    wires.set(B, leaves.plain_door());
    wires.set(C, refuses());
    let cluster = start(&wires, &[A, B, C]).await;
    // From now on they are dialled at different times.
    sleep(Duration::from_millis(20_300)).await;
    drop(leaves);
    wires.set(B, refuses());
    sleep(Duration::from_millis(13_000)).await;
    let [again, late] = [(); 2].map(|()| Process::start(SOON));
    wires.set(B, again.plain_door());
    wires.set(C, late.plain_door());
    until(&cluster, C, is_there).await;
    let began = Instant::now();
    until(&cluster, B, is_there).await;
    assert!(began.elapsed() <= Duration::from_millis(50), "{:?}", began.elapsed());
}

#[tokio::test(start_paused = true)]
async fn one_that_answers_and_leaves_is_dialled_soon_and_then_more_rarely() {
    let wires = Arc::new(Wires::default());
    let [here, flaps] = [(); 2].map(|()| Process::start(SOON));
    wires.set(A, here.plain_door());
    wires.set(B, refuses());
    let _cluster = start(&wires, &[A, B]).await;
    sleep(Duration::from_secs(60)).await;
    let dialled = Arc::new(Mutex::new(vec![]));
    let times = Arc::clone(&dialled);
    wires.set(
        B,
        flaps.door(move |_, far| {
            times.lock().unwrap().push(Instant::now());
            Some(cut_after(Duration::from_millis(100), far))
        }),
    );
    sleep(Duration::from_secs(30)).await;
    // Jobs and uploads have a connection each.
    let mut times = dialled.lock().unwrap().clone();
    times.dedup();
    let pauses: Vec<_> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(pauses[0] < Duration::from_millis(700) && pauses.is_sorted(), "{pauses:?}");
    assert!(*pauses.last().unwrap() > Duration::from_secs(2), "{pauses:?}");
}
