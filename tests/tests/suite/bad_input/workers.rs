//! Workers that are not there, not of this release, or lost on the way.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use protocol::worker::worker_message::Body;
use protocol::worker::worker_server::{Worker, WorkerServer};
use protocol::worker::{
    CoordinatorMessage, LoadReplicaReply, PROTOCOL_VERSION, ReplicaChunk, WorkerHello, WorkerMessage,
};
use tests::programs::{WorkerProcess, binary};
use tokio::net::TcpListener;
use tokio_stream::StreamExt;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::transport::Server;
use tonic::{Request, Response, Status, Streaming};

use super::{Bench, HANGS};

#[test]
fn nobody_at_the_address() {
    // Bound, but never listened on: no other program gets the port meanwhile.
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let _entered = runtime.enter();
    let closed = tokio::net::TcpSocket::new_v4().unwrap();
    closed.bind("127.0.0.1:0".parse().unwrap()).unwrap();
    let address = closed.local_addr().unwrap().to_string();
    let bench = Bench::good();
    bench.assert_refused(
        &bench.output(),
        &["--workers", &address, "--worker-grace", "0.5"],
        &[&address, "no worker answers", "worker --listen"],
    );
}

#[test]
fn not_an_address() {
    let bench = Bench::good();
    bench.assert_refused(&bench.output(), &["--workers", "worker"], &["\"worker\"", "write host:port"]);
}

#[test]
fn worker_of_another_protocol_version() {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let listener = runtime.block_on(TcpListener::bind("127.0.0.1:0")).unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let service = WorkerServer::new(FutureWorker);
    runtime
        .spawn(Server::builder().add_service(service).serve_with_incoming(TcpListenerStream::new(listener)));
    let bench = Bench::good();
    let ours = format!("this coordinator version {PROTOCOL_VERSION}");
    let words = [address.as_str(), "speaks protocol version 99", &ours, "install the same release"];
    bench.assert_refused(&bench.output(), &["--workers", &address], &words);
    runtime.shutdown_background();
}

/// Says hello in another version, and nothing more.
struct FutureWorker;

#[tonic::async_trait]
impl Worker for FutureWorker {
    type SessionStream =
        std::pin::Pin<Box<dyn tokio_stream::Stream<Item = Result<WorkerMessage, Status>> + Send>>;

    async fn session(
        &self,
        _: Request<Streaming<CoordinatorMessage>>,
    ) -> Result<Response<Self::SessionStream>, Status> {
        let hello = WorkerHello {
            protocol_version: 99,
            threads: 1,
            name: "future".into(),
            software_version: "99".into(),
            instance: 99,
            row_version: 99,
            largest_replica: 0,
            passes_replicas: false,
        };
        let messages = tokio_stream::once(Ok(WorkerMessage { body: Some(Body::Hello(hello)) }));
        Ok(Response::new(Box::pin(messages.chain(tokio_stream::pending()))))
    }

    async fn load_replica(
        &self,
        _: Request<Streaming<ReplicaChunk>>,
    ) -> Result<Response<LoadReplicaReply>, Status> {
        Err(Status::unimplemented("replicas are loaded otherwise in version 99"))
    }
}

/// Kills all workers in the middle of a bake that would go on for long. The coordinator must end by itself, and say why.
#[test]
fn all_workers_lost() {
    let bench = Bench::good();
    let mut workers = [WorkerProcess::start(1), WorkerProcess::start(1)];
    let addresses = workers.each_ref().map(|worker| worker.address.as_str()).join(",");
    let child = Command::new(binary("coordinator"))
        .arg("solve")
        .arg(tests::data("scenes/doorway.glb"))
        .arg("-o")
        .arg(bench.output())
        .args(["--workers", &addresses, "--worker-grace", "1", "--mesh-error", "1e-5"])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut child = Ending(child);
    let mut lines = BufReader::new(child.0.stderr.take().unwrap()).lines();
    // Once it has asked for rows, the bake is under way.
    assert!(lines.by_ref().any(|line| line.unwrap().contains("rows")));
    workers.iter_mut().for_each(WorkerProcess::kill);
    let deadline = Instant::now() + HANGS;
    let status = loop {
        if let Some(status) = child.0.try_wait().unwrap() {
            break status;
        }
        assert!(Instant::now() < deadline, "still waiting for workers that are lost");
        std::thread::sleep(Duration::from_millis(50));
    };
    assert!(!status.success());
    let said: Vec<String> = lines.map(Result::unwrap).collect();
    let said = said.join("\n");
    for word in
        ["error: ", "all workers are lost"].into_iter().chain(workers.iter().map(|w| w.address.as_str()))
    {
        assert!(said.contains(word), "{word:?} is missing in: {said}");
    }
    assert!(!said.contains("panicked"), "{said}");
    bench.assert_nothing_written();
}

/// A process that ends with the test.
struct Ending(Child);

impl Drop for Ending {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
