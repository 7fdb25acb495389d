//! A worker as a coordinator sees it, message by message.

use std::io;
use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::replica::{Digest, EncodedReplica, Receiver, Receivers, encode_receivers, encode_scene};
use kernel::row::{Precision, ROW_VERSION, RowRequest, Shape, Shooter};
use protocol::network::Sockets;
use protocol::security::{ClientSecurity, Token};
use protocol::server::unwatched;
use protocol::worker::coordinator_message::Body as Outgoing;
use protocol::worker::worker_client::WorkerClient;
use protocol::worker::worker_message::Body as Incoming;
use protocol::worker::{
    CoordinatorHello, CoordinatorMessage, FailureReason, Goodbye, KeepAlive, MAX_MESSAGE_BYTES,
    PROTOCOL_VERSION, PassOutcome, PassReplica, ReplicaChunk, ReplicaHeader, WorkerMessage, replica_chunk,
};
use tokio::net::TcpListener;
use tokio::sync::mpsc;
use tokio_stream::wrappers::{TcpListenerStream, UnboundedReceiverStream};
use tokio_util::sync::CancellationToken;
use tonic::transport::Channel;
use tonic::{Code, Status, Streaming};
use worker::Settings;
use worker::passing::Passing;

/// A worker of one thread, and a coordinator's connection to it.
struct Setup {
    address: SocketAddr,
    client: WorkerClient<Channel>,
    shutdown: CancellationToken,
    serving: tokio::task::JoinHandle<Result<(), worker::ServeError>>,
}

async fn setup() -> io::Result<Setup> {
    setup_with(Settings { instance: 1, ..Settings::new("test", NonZeroUsize::MIN) }).await
}

/// The same, with these settings.
async fn setup_with(settings: Settings) -> io::Result<Setup> {
    let listener = TcpListener::bind("127.0.0.1:0").await?;
    let address = listener.local_addr()?;
    let shutdown = CancellationToken::new();
    let settings = Settings { replica_bytes: 4 << 20, ..settings };
    let incoming = unwatched(TcpListenerStream::new(listener));
    let serving = tokio::spawn(worker::serve(incoming, settings, shutdown.clone()));
    let client = WorkerClient::connect(format!("http://{address}")).await.map_err(io::Error::other)?;
    let client = client.max_decoding_message_size(MAX_MESSAGE_BYTES);
    Ok(Setup { address, client, shutdown, serving })
}

struct Session {
    outbound: mpsc::UnboundedSender<CoordinatorMessage>,
    inbound: Streaming<WorkerMessage>,
}

impl Session {
    /// Opens a session; the worker's hello is the next message.
    async fn open(client: &mut WorkerClient<Channel>, protocol_version: u32) -> Self {
        Self::open_as(client, protocol_version, ROW_VERSION).await
    }

    /// The same, with a row version.
    async fn open_as(client: &mut WorkerClient<Channel>, protocol_version: u32, row_version: u32) -> Self {
        let (outbound, messages) = mpsc::unbounded_channel();
        let inbound = client.session(UnboundedReceiverStream::new(messages)).await.unwrap().into_inner();
        let mut session = Self { outbound, inbound };
        let hello = CoordinatorHello { protocol_version, name: "test".into(), row_version };
        session.say(Outgoing::Hello(hello));
        let Incoming::Hello(hello) = session.hear().await.unwrap() else { panic!("no hello") };
        assert_eq!((hello.protocol_version, hello.threads), (PROTOCOL_VERSION, 1));
        assert_eq!((hello.row_version, hello.largest_replica), (ROW_VERSION, 1 << 20));
        session
    }

    fn say(&self, body: Outgoing) {
        self.outbound.send(CoordinatorMessage { body: Some(body) }).unwrap();
    }

    fn ask(&self, job: u64, request: &RowRequest) {
        self.say(Outgoing::Job(request.to_job(job)));
    }

    async fn hear(&mut self) -> Result<Incoming, Status> {
        let message = self.inbound.message().await?;
        Ok(message.and_then(|message| message.body).expect("the worker has ended the session"))
    }

    async fn is_over(&mut self) -> bool {
        self.inbound.message().await.unwrap().is_none()
    }
}

/// Replicas, and a job that keeps a thread busy for so many rows.
fn work(rows: u64) -> ([EncodedReplica; 2], RowRequest) {
    let receiver = |x| Receiver { position: DVec3::X * f64::from(x), normal: DVec3::Y, plane: PlaneId(0) };
    let set = Receivers { first_key: 0, receivers: (0..1000).map(receiver).collect() };
    let (scene, receivers) = (encode_scene(&[]), encode_receivers(&set));
    let request = RowRequest {
        scene: scene.digest,
        receivers: receivers.digest,
        first_receiver: 0,
        receiver_count: 1000,
        shooters: (0..rows).map(|key| Shooter { key, shape: Shape::Point(DVec3::Y) }).collect(),
        precision: Precision {
            rays_per_hemisphere: 64,
            minimum_rays: 1,
            maximum_rays: 64,
            seed: 1,
            ..Precision::DEFAULT
        },
    };
    ([scene, receivers], request)
}

fn chunks(replica: &EncodedReplica) -> Vec<ReplicaChunk> {
    let header = ReplicaHeader {
        digest: replica.digest.to_bytes(),
        kind: replica.kind.into(),
        length: replica.bytes.len() as u64,
        packed_length: 0,
        passed_to: 0,
    };
    [replica_chunk::Body::Header(header), replica_chunk::Body::Data(replica.bytes.clone())]
        .map(|body| ReplicaChunk { body: Some(body) })
        .to_vec()
}

async fn load(client: &mut WorkerClient<Channel>, chunks: Vec<ReplicaChunk>) -> Result<bool, Status> {
    let reply = client.load_replica(tokio_stream::iter(chunks)).await?;
    Ok(reply.into_inner().already_held)
}

#[tokio::test]
async fn a_coordinator_of_another_version_is_refused() {
    let Setup { mut client, .. } = setup().await.unwrap();
    let mut session = Session::open(&mut client, PROTOCOL_VERSION + 1).await;
    let status = session.hear().await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    for version in [PROTOCOL_VERSION, PROTOCOL_VERSION + 1] {
        assert!(status.message().contains(&format!("version {version}")), "{}", status.message());
    }
}

#[tokio::test]
async fn a_coordinator_of_another_row_version_is_refused() {
    let Setup { mut client, .. } = setup().await.unwrap();
    // 0 is what a release sends that does not know the field.
    for theirs in [0, ROW_VERSION + 1] {
        let mut session = Session::open_as(&mut client, PROTOCOL_VERSION, theirs).await;
        let status = session.hear().await.unwrap_err();
        assert_eq!(status.code(), Code::FailedPrecondition);
        let (theirs, ours) = (format!("row version {theirs}"), format!("this worker version {ROW_VERSION}"));
        for words in [theirs.as_str(), &ours, "install the same release"] {
            assert!(status.message().contains(words), "{}", status.message());
        }
    }
}

#[tokio::test]
async fn a_replica_is_taken_once_and_only_whole() {
    let Setup { mut client, .. } = setup().await.unwrap();
    let ([scene, receivers], _) = work(1);
    assert!(!load(&mut client, chunks(&scene)).await.unwrap());
    assert!(load(&mut client, chunks(&scene)[..1].to_vec()).await.unwrap());

    let cut = load(&mut client, chunks(&receivers)[..1].to_vec()).await.unwrap_err();
    assert_eq!(cut.code(), Code::InvalidArgument);
    let changed = EncodedReplica { digest: Digest::of(b"other"), ..receivers.clone() };
    assert_eq!(load(&mut client, chunks(&changed)).await.unwrap_err().code(), Code::InvalidArgument);
    let headless = load(&mut client, chunks(&receivers)[1..].to_vec()).await.unwrap_err();
    assert_eq!(headless.code(), Code::InvalidArgument);
    let mut endless = chunks(&receivers);
    let Some(replica_chunk::Body::Header(header)) = &mut endless[0].body else { panic!("no header") };
    header.length = 1 << 40;
    assert_eq!(load(&mut client, endless).await.unwrap_err().code(), Code::ResourceExhausted);
}

#[tokio::test]
async fn jobs_that_cannot_be_done_say_why() {
    let Setup { mut client, .. } = setup().await.unwrap();
    let ([scene, receivers], request) = work(1);
    let mut session = Session::open(&mut client, PROTOCOL_VERSION).await;
    load(&mut client, chunks(&scene)).await.unwrap();
    session.ask(1, &request);
    let Incoming::Failed(failed) = session.hear().await.unwrap() else { panic!("not failed") };
    assert_eq!((failed.job_id, failed.reason()), (1, FailureReason::UnknownReplica));

    load(&mut client, chunks(&receivers)).await.unwrap();
    session.ask(2, &RowRequest { first_receiver: 1, ..request });
    let Incoming::Failed(failed) = session.hear().await.unwrap() else { panic!("not failed") };
    assert_eq!((failed.job_id, failed.reason()), (2, FailureReason::InvalidJob));
}

#[tokio::test]
async fn keep_alives_are_answered_while_every_thread_computes() {
    let Setup { mut client, .. } = setup().await.unwrap();
    let (replicas, request) = work(10_000);
    for replica in &replicas {
        load(&mut client, chunks(replica)).await.unwrap();
    }
    let mut session = Session::open(&mut client, PROTOCOL_VERSION).await;
    session.ask(1, &request);
    session.say(Outgoing::KeepAlive(KeepAlive { number: 7, uploaded: 0 }));
    let Incoming::KeepAlive(answer) = session.hear().await.unwrap() else { panic!("no keep-alive") };
    // Both replicas came before.
    let bytes: usize = replicas.iter().map(|replica| replica.bytes.len()).sum();
    assert!(answer.number == 7 && answer.uploaded >= bytes as u64, "{answer:?} after {bytes} bytes");
    assert!(matches!(session.hear().await.unwrap(), Incoming::Finished(_)));
}

/// A row that nobody waits for keeps no thread.
#[tokio::test]
async fn a_job_ends_when_its_coordinator_is_gone() {
    let settings = Settings { instance: 1, ..Settings::new("test", NonZeroUsize::MIN) };
    let computing = settings.metrics.jobs_computing.clone();
    let Setup { mut client, .. } = setup_with(settings).await.unwrap();
    // A lamp behind shades: some 10^9 rays.
    let corner = |x: f64, z: f64| DVec3::new(x, 1.0, z);
    let shade = |plane: u32, x: f64| {
        let corners = [(x, 0.0), (x, 0.9), (x + 0.9, 0.9), (x + 0.9, 0.0)].map(|(x, z)| corner(x, z));
        ConvexPolygon { plane: PlaneId(plane), corners: corners.to_vec() }
    };
    let shades: Vec<ConvexPolygon> = (1..500).map(|plane| shade(plane, f64::from(plane))).collect();
    let lamp =
        [(-1e3, -1e3), (1e3, -1e3), (1e3, 1e3), (-1e3, 1e3)].map(|(x, z)| DVec3::new(x, 2.0, z)).to_vec();
    let ([_, receivers], request) = work(1);
    let scene = encode_scene(&shades);
    let shape = Shape::Polygons(vec![ConvexPolygon { plane: PlaneId(1000), corners: lamp }]);
    let request = RowRequest {
        scene: scene.digest,
        shooters: vec![Shooter { key: 1, shape }; 16],
        precision: Precision {
            rays_per_hemisphere: 1 << 16,
            minimum_rays: 1 << 16,
            maximum_rays: 1 << 16,
            exact_occluders: 0,
            ..request.precision
        },
        ..request
    };
    for replica in [&scene, &receivers] {
        load(&mut client, chunks(replica)).await.unwrap();
    }
    let is_computing = async |wanted: i64| {
        while computing.get() != wanted {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    let session = Session::open(&mut client, PROTOCOL_VERSION).await;
    session.ask(1, &request);
    is_computing(1).await;
    drop(session);
    tokio::time::timeout(Duration::from_secs(30), is_computing(0)).await.expect("it goes on");
}

#[tokio::test]
async fn a_goodbye_lets_all_jobs_finish() {
    let Setup { mut client, .. } = setup().await.unwrap();
    let (replicas, request) = work(20);
    for replica in &replicas {
        load(&mut client, chunks(replica)).await.unwrap();
    }
    let mut session = Session::open(&mut client, PROTOCOL_VERSION).await;
    (0..5).for_each(|job| session.ask(job, &request));
    session.say(Outgoing::Goodbye(Goodbye::default()));
    // The coordinator's half closes at once.
    session.outbound = mpsc::unbounded_channel().0;
    for _ in 0..5 {
        let Incoming::Finished(finished) = session.hear().await.unwrap() else { panic!("not finished") };
        assert_eq!(finished.rows.len(), 20);
    }
    assert!(matches!(session.hear().await.unwrap(), Incoming::Goodbye(_)));
    assert!(session.is_over().await);
}

#[tokio::test]
async fn a_worker_told_to_stop_says_goodbye_and_leaves() {
    let Setup { mut client, shutdown, serving, .. } = setup().await.unwrap();
    let mut session = Session::open(&mut client, PROTOCOL_VERSION).await;
    shutdown.cancel();
    assert!(matches!(session.hear().await.unwrap(), Incoming::Goodbye(_)));
    assert!(session.is_over().await);
    serving.await.unwrap().unwrap();
}

/// A worker that passes replicas on with this token.
fn passing(token: Option<&Token>) -> Settings {
    let security = ClientSecurity { token: token.cloned(), ..ClientSecurity::default() };
    let passing = Passing { network: Arc::new(Sockets), security };
    Settings { instance: 1, passing: Some(passing), ..Settings::new("from", NonZeroUsize::MIN) }
}

/// Has a worker that holds a replica, or does not, pass it on to another one. How it says that went.
async fn pass(settings: Settings, holds: bool, to: &Setup, instance: u64) -> (PassOutcome, String) {
    let Setup { mut client, .. } = setup_with(settings).await.unwrap();
    let mut session = Session::open(&mut client, PROTOCOL_VERSION).await;
    let ([_, receivers], _) = work(1);
    if holds {
        load(&mut client, chunks(&receivers)).await.unwrap();
    }
    session.say(Outgoing::Pass(PassReplica {
        number: 7,
        digest: receivers.digest.to_bytes(),
        name: "localhost:1".into(),
        address: to.address.to_string(),
        instance,
    }));
    let Incoming::Passed(passed) = session.hear().await.unwrap() else { panic!("not passed") };
    assert_eq!((passed.number, &passed.digest), (7, &receivers.digest.to_bytes()));
    (passed.outcome(), passed.message)
}

#[tokio::test]
async fn a_replica_is_passed_on_to_the_worker_that_is_meant_and_nobody_else() {
    let token = Token::new("0123456789abcdef").unwrap();
    let demanding =
        Settings { instance: 2, token: Some(token.clone()), ..Settings::new("to", NonZeroUsize::MIN) };
    let to = setup_with(demanding).await.unwrap();
    let (outcome, message) = pass(passing(None), true, &to, 2).await;
    assert!(outcome == PassOutcome::Failed && message.contains("token"), "{message}");
    let (outcome, message) = pass(passing(Some(&token)), true, &to, 3).await;
    assert!(outcome == PassOutcome::Failed && message.contains("another worker"), "{message}");
    let (outcome, message) = pass(passing(Some(&token)), false, &to, 2).await;
    assert_eq!((outcome, message.as_str()), (PassOutcome::NotHeld, ""));
    let (outcome, message) = pass(passing(Some(&token)), true, &to, 2).await;
    assert_eq!((outcome, message.as_str()), (PassOutcome::Done, ""));
}

#[tokio::test]
async fn who_gets_a_replica_from_another_worker_tells_its_coordinator() {
    let mut to = setup().await.unwrap();
    let mut session = Session::open(&mut to.client, PROTOCOL_VERSION).await;
    let (outcome, message) = pass(passing(None), true, &to, 1).await;
    assert_eq!(outcome, PassOutcome::Done, "{message}");
    let ([scene, receivers], request) = work(1);
    let Incoming::Held(held) = session.hear().await.unwrap() else { panic!("not told") };
    assert_eq!(held.digest, receivers.digest.to_bytes());
    load(&mut to.client, chunks(&scene)).await.unwrap();
    session.ask(1, &request);
    let Incoming::Finished(finished) = session.hear().await.unwrap() else { panic!("not finished") };
    assert_eq!(finished.rows.len(), 1);
}
