//! Workers on sockets of this machine, real and faked, each with a runtime of its own that ends with it.

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;

use kernel::replica::Digest;
use kernel::row::ROW_VERSION;
use protocol::server::unwatched;
use protocol::worker::coordinator_message::Body as Incoming;
use protocol::worker::replica_chunk::Body as Chunk;
use protocol::worker::worker_client::WorkerClient;
use protocol::worker::worker_message::Body;
use protocol::worker::worker_server::{Worker, WorkerServer};
use protocol::worker::{
    CoordinatorHello, CoordinatorMessage, KeepAlive, LoadReplicaReply, PROTOCOL_VERSION, ReleaseReplica,
    ReplicaChunk, ReplicaHeader, RowJob, WorkerHello, WorkerMessage,
};
use tokio::net::TcpListener;
use tokio::runtime::Runtime;
use tokio::sync::mpsc;
use tokio_stream::wrappers::{ReceiverStream, TcpListenerStream};
use tokio_util::sync::CancellationToken;
use tonic::transport::Server as GrpcServer;
use tonic::{Request, Response, Status, Streaming};
use worker::Settings;

pub struct Server {
    pub address: String,
    runtime: Option<Runtime>,
    shutdown: CancellationToken,
}

impl Server {
    fn start(serve: impl FnOnce(&Runtime, TcpListenerStream, CancellationToken)) -> Self {
        Self::start_at("127.0.0.1:0", serve)
    }

    fn start_at(address: &str, serve: impl FnOnce(&Runtime, TcpListenerStream, CancellationToken)) -> Self {
        let runtime =
            tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let listener = runtime.block_on(async {
            // Whoever was there before may be about to leave.
            for _ in 0..100 {
                if let Ok(listener) = TcpListener::bind(address).await {
                    return listener;
                }
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
            TcpListener::bind(address).await.unwrap()
        });
        let address = listener.local_addr().unwrap().to_string();
        let shutdown = CancellationToken::new();
        serve(&runtime, TcpListenerStream::new(listener), shutdown.clone());
        Self { address, runtime: Some(runtime), shutdown }
    }

    /// A real worker of one thread.
    pub fn real() -> Self {
        Self::real_at("127.0.0.1:0")
    }

    /// The same at a given address.
    pub fn real_at(address: &str) -> Self {
        Self::start_at(address, |runtime, incoming, shutdown| {
            let settings = Settings { replica_bytes: 1 << 20, ..Settings::new("real", NonZeroUsize::MIN) };
            runtime.spawn(worker::serve(unwatched(incoming), settings, shutdown));
        })
    }

    /// Answers jobs as it pleases.
    pub fn fake(
        protocol_version: u32,
        answer: impl Fn(&RowJob) -> Option<Body> + Send + Sync + 'static,
    ) -> Self {
        let instance = Settings::random_instance();
        let answer = Arc::new(answer);
        let load = takes_all();
        let row_version = ROW_VERSION;
        Self::fake_with(Fake { protocol_version, row_version, hears: true, instance, answer, load })
    }

    /// The same, of this version.
    pub fn fake_worker(answer: impl Fn(&RowJob) -> Option<Body> + Send + Sync + 'static) -> Self {
        Self::fake(PROTOCOL_VERSION, answer)
    }

    /// Says hello, and then nothing ever.
    pub fn deaf() -> Self {
        Self::of_row_version(ROW_VERSION)
    }

    /// The same, of this row version.
    pub fn of_row_version(row_version: u32) -> Self {
        let instance = Settings::random_instance();
        let answer = Arc::new(|_: &RowJob| None);
        let protocol_version = PROTOCOL_VERSION;
        let load = takes_all();
        Self::fake_with(Fake { protocol_version, row_version, hears: false, instance, answer, load })
    }

    fn fake_with(fake: Fake) -> Self {
        Self::start(|runtime, incoming, _| {
            let service = WorkerServer::new(fake);
            runtime.spawn(GrpcServer::builder().add_service(service).serve_with_incoming(incoming));
        })
    }

    /// As a worker that gets a signal.
    pub fn stop(&self) {
        self.shutdown.cancel();
    }

    /// Makes a real worker forget these replicas, as another coordinator may.
    pub fn forget(&self, digests: &[Digest]) {
        let (protocol_version, row_version) = (PROTOCOL_VERSION, ROW_VERSION);
        let hello = CoordinatorHello { protocol_version, name: "other".into(), row_version };
        let release = |digest: &Digest| Incoming::Release(ReleaseReplica { digest: digest.to_bytes() });
        let mut messages = vec![Incoming::Hello(hello)];
        messages.extend(digests.iter().map(release));
        // Its answer tells that all before it was heard.
        messages.push(Incoming::KeepAlive(KeepAlive { number: 1, uploaded: 0 }));
        let messages: Vec<_> =
            messages.into_iter().map(|body| CoordinatorMessage { body: Some(body) }).collect();
        let address = format!("http://{}", self.address);
        self.runtime.as_ref().unwrap().block_on(async {
            let mut client = WorkerClient::connect(address).await.unwrap();
            let mut answers = client.session(tokio_stream::iter(messages)).await.unwrap().into_inner();
            while let Some(message) = answers.message().await.unwrap() {
                if matches!(message.body, Some(Body::KeepAlive(_))) {
                    return;
                }
            }
            panic!("no answer");
        });
    }
}

impl Drop for Server {
    /// As a machine that loses its power.
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

/// What a fake says to a job, if anything.
type Answer = dyn Fn(&RowJob) -> Option<Body> + Send + Sync;

/// What a fake does with a replica.
type Load = dyn Fn(&ReplicaHeader) -> Result<(), Status> + Send + Sync;

fn takes_all() -> Arc<Load> {
    Arc::new(|_| Ok(()))
}

#[derive(Clone)]
pub struct Fake {
    protocol_version: u32,
    row_version: u32,
    /// Whether it takes messages in.
    hears: bool,
    instance: u64,
    answer: Arc<Answer>,
    load: Arc<Load>,
}

impl Fake {
    /// One that answers jobs and takes replicas as it pleases.
    pub fn new(
        answer: impl Fn(&RowJob) -> Option<Body> + Send + Sync + 'static,
        load: impl Fn(&ReplicaHeader) -> Result<(), Status> + Send + Sync + 'static,
    ) -> Self {
        Self {
            protocol_version: PROTOCOL_VERSION,
            row_version: ROW_VERSION,
            hears: true,
            instance: Settings::random_instance(),
            answer: Arc::new(answer),
            load: Arc::new(load),
        }
    }

    /// The same, of this version of the protocol.
    pub fn of_version(self, protocol_version: u32) -> Self {
        Self { protocol_version, ..self }
    }
}

#[tonic::async_trait]
impl Worker for Fake {
    type SessionStream = ReceiverStream<Result<WorkerMessage, Status>>;

    async fn session(
        &self,
        request: Request<Streaming<CoordinatorMessage>>,
    ) -> Result<Response<Self::SessionStream>, Status> {
        let mut inbound = request.into_inner();
        let (outbound, answers) = mpsc::channel(64);
        let fake = self.clone();
        tokio::spawn(async move {
            let hello = WorkerHello {
                protocol_version: fake.protocol_version,
                threads: 1,
                name: "fake".into(),
                software_version: "0".into(),
                instance: fake.instance,
                row_version: fake.row_version,
                largest_replica: 0,
                passes_replicas: false,
            };
            let send = async |body| outbound.send(Ok(WorkerMessage { body: Some(body) })).await;
            let _ = send(Body::Hello(hello)).await;
            if !fake.hears {
                std::future::pending::<()>().await;
            }
            while let Ok(Some(message)) = inbound.message().await {
                let answer = match message.body {
                    Some(Incoming::Job(job)) => (fake.answer)(&job),
                    Some(Incoming::KeepAlive(keep_alive)) => Some(Body::KeepAlive(keep_alive)),
                    _ => None,
                };
                if let Some(answer) = answer {
                    let _ = send(answer).await;
                }
            }
        });
        Ok(Response::new(ReceiverStream::new(answers)))
    }

    /// Holds everything already that it takes.
    async fn load_replica(
        &self,
        request: Request<Streaming<ReplicaChunk>>,
    ) -> Result<Response<LoadReplicaReply>, Status> {
        let first = request.into_inner().message().await?;
        let Some(Chunk::Header(header)) = first.and_then(|chunk| chunk.body) else { panic!("no header") };
        (self.load)(&header)?;
        Ok(Response::new(LoadReplicaReply { already_held: true, digest: header.digest }))
    }
}
