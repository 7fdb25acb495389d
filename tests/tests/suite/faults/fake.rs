//! A worker in the test's own process: it computes as a real one does, and then does as the test tells it.

use std::sync::{Arc, Mutex};

use kernel::row::ROW_VERSION;
use protocol::worker::coordinator_message::Body as Incoming;
use protocol::worker::replica_chunk::Body as Chunk;
use protocol::worker::worker_message::Body as Outgoing;
use protocol::worker::worker_server::{Worker, WorkerServer};
use protocol::worker::{
    CoordinatorMessage, LoadReplicaReply, PROTOCOL_VERSION, ReplicaChunk, RowJob, WorkerHello, WorkerMessage,
};
use tokio::net::TcpListener;
use tokio::runtime::Runtime;
use tokio::sync::mpsc;
use tokio_stream::wrappers::{TcpListenerStream, UnboundedReceiverStream};
use tonic::transport::Server;
use tonic::{Request, Response, Status, Streaming};
use worker::job::{Job, answer};
use worker::store::ReplicaStore;
use worker::upload::Upload;

/// What becomes of a job: given the job and its honest answer, the messages to send; none: the worker dies over it.
type Behaviour = dyn Fn(&RowJob, Outgoing) -> Option<Vec<Outgoing>> + Send + Sync;

/// A worker on a socket of this machine; ends when dropped.
pub struct FakeWorker {
    pub address: String,
    runtime: Option<Runtime>,
}

/// What it is.
#[derive(Clone)]
pub struct Nature {
    pub protocol_version: u32,
    /// Whether it says of each replica that it holds another one.
    pub mixes_replicas_up: bool,
    pub behaviour: Arc<Behaviour>,
}

impl Nature {
    /// One that answers jobs like this.
    pub fn answering(
        behaviour: impl Fn(&RowJob, Outgoing) -> Option<Vec<Outgoing>> + Send + Sync + 'static,
    ) -> Self {
        Self { protocol_version: PROTOCOL_VERSION, mixes_replicas_up: false, behaviour: Arc::new(behaviour) }
    }

    /// One without a fault.
    pub fn honest() -> Self {
        Self::answering(|_, honest| Some(vec![honest]))
    }
}

impl FakeWorker {
    pub fn start(nature: Nature) -> Self {
        let runtime =
            tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
        let listener = runtime.block_on(TcpListener::bind("127.0.0.1:0")).unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let service = WorkerServer::new(Service {
            nature,
            instance: worker::Settings::random_instance(),
            store: Arc::new(Mutex::new(ReplicaStore::new(1 << 30))),
        });
        let service = service
            .max_decoding_message_size(protocol::worker::MAX_MESSAGE_BYTES)
            .max_encoding_message_size(protocol::worker::MAX_MESSAGE_BYTES);
        runtime.spawn(
            Server::builder().add_service(service).serve_with_incoming(TcpListenerStream::new(listener)),
        );
        Self { address, runtime: Some(runtime) }
    }
}

impl Drop for FakeWorker {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

#[derive(Clone)]
struct Service {
    nature: Nature,
    instance: u64,
    store: Arc<Mutex<ReplicaStore>>,
}

impl Service {
    /// Answers a coordinator until it leaves, or a job is the end of this worker.
    async fn converse(
        self,
        mut inbound: Streaming<CoordinatorMessage>,
        outbound: mpsc::UnboundedSender<Result<WorkerMessage, Status>>,
    ) {
        let send = |body| outbound.send(Ok(WorkerMessage { body: Some(body) })).is_ok();
        send(Outgoing::Hello(WorkerHello {
            protocol_version: self.nature.protocol_version,
            threads: 1,
            name: "fake".into(),
            software_version: "0".into(),
            instance: self.instance,
            row_version: ROW_VERSION,
            largest_replica: 0,
            passes_replicas: false,
        }));
        while let Ok(Some(message)) = inbound.message().await {
            match message.body {
                Some(Incoming::Job(job)) => {
                    let prepared = Job::new(&job, &mut self.store.lock().unwrap());
                    let honest = answer(job.job_id, prepared.map(|job| Outgoing::Finished(job.compute())));
                    let Some(replies) = (self.nature.behaviour)(&job, honest) else {
                        // As a process that dies: the session breaks off.
                        let _ = outbound.send(Err(Status::unknown("killed")));
                        return;
                    };
                    replies.into_iter().for_each(|reply| {
                        send(reply);
                    });
                }
                Some(Incoming::KeepAlive(keep_alive)) => {
                    send(Outgoing::KeepAlive(keep_alive));
                }
                _ => {}
            }
        }
    }
}

#[tonic::async_trait]
impl Worker for Service {
    type SessionStream = UnboundedReceiverStream<Result<WorkerMessage, Status>>;

    async fn session(
        &self,
        request: Request<Streaming<CoordinatorMessage>>,
    ) -> Result<Response<Self::SessionStream>, Status> {
        let (outbound, answers) = mpsc::unbounded_channel();
        tokio::spawn(self.clone().converse(request.into_inner(), outbound));
        Ok(Response::new(UnboundedReceiverStream::new(answers)))
    }

    async fn load_replica(
        &self,
        request: Request<Streaming<ReplicaChunk>>,
    ) -> Result<Response<LoadReplicaReply>, Status> {
        let mut chunks = request.into_inner();
        let mut upload = None;
        while let Some(chunk) = chunks.message().await? {
            match chunk.body {
                Some(Chunk::Header(header)) => upload = Some(Upload::begin(&header, 1 << 30).unwrap()),
                Some(Chunk::Data(data)) => upload.as_mut().unwrap().push(&data).unwrap(),
                None => {}
            }
        }
        let upload = upload.unwrap();
        let (mut digest, length) = (upload.digest(), upload.length());
        self.store.lock().unwrap().insert(digest, upload.finish().unwrap(), length);
        if self.nature.mixes_replicas_up {
            digest.0[0] ^= 1;
        }
        Ok(Response::new(LoadReplicaReply { already_held: false, digest: digest.to_bytes() }))
    }
}
