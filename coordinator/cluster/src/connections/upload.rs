//! Sends a replica to a worker.

use std::time::Duration;

use kernel::replica::{Digest, EncodedReplica};
use protocol::security::SecuredChannel;
use protocol::worker::replica_chunk::Body;
use protocol::worker::worker_client::WorkerClient;
use protocol::worker::{LoadReplicaReply, ReplicaChunk, ReplicaHeader};
use tokio::time::timeout;

use super::error::{is_refusal, is_refusal_of_replica, words};

/// Bytes per chunk: large enough to cost nothing, small enough to let other messages through, and to show on a slow link that the
/// upload gets on.
const CHUNK_BYTES: usize = 64 << 10;

/// Time limit of an upload, plus a second for each [`SLOWEST_BYTES`]. One that does not get on is found sooner, by the session.
const UPLOAD_TIMEOUT: Duration = Duration::from_secs(60);
const SLOWEST_BYTES: u64 = 100_000;

/// Why an upload failed.
#[derive(Debug, thiserror::Error)]
pub(super) enum UploadFailure {
    /// The worker does not take this replica, and would not if it came again. It may take others.
    #[error("{0}")]
    Refused(String),
    /// The worker gives an impossible answer.
    #[error("{0}")]
    Impossible(String),
    /// The connection failed.
    #[error("{0}")]
    Broken(String),
}

/// Sends a replica to a worker. Ends when the worker can use it.
pub(super) async fn upload(
    mut client: WorkerClient<SecuredChannel>,
    replica: EncodedReplica,
) -> (Digest, Result<(), UploadFailure>) {
    let digest = replica.digest;
    let limit = UPLOAD_TIMEOUT + Duration::from_secs(replica.bytes.len() as u64 / SLOWEST_BYTES);
    let loading = client.load_replica(tokio_stream::iter(chunks(replica)));
    let result = match timeout(limit, loading).await {
        Err(_) => Err(UploadFailure::Broken(format!("it took more than {} s", limit.as_secs()))),
        Ok(Err(status)) if is_refusal_of_replica(&status) => Err(UploadFailure::Refused(words(&status))),
        Ok(Err(status)) if is_refusal(&status) => Err(UploadFailure::Impossible(words(&status))),
        Ok(Err(status)) => Err(UploadFailure::Broken(words(&status))),
        Ok(Ok(reply)) => check(digest, reply.get_ref()),
    };
    (digest, result)
}

/// Compares the worker's digest with that of the replica sent.
fn check(digest: Digest, reply: &LoadReplicaReply) -> Result<(), UploadFailure> {
    match Digest::try_from(reply.digest.as_ref()) {
        Ok(theirs) if theirs == digest => {
            tracing::debug!(replica = %digest, already_held = reply.already_held, "replica loaded");
            Ok(())
        }
        Ok(theirs) => Err(UploadFailure::Impossible(format!("it says that it holds replica {theirs}"))),
        Err(error) => Err(UploadFailure::Impossible(error.to_string())),
    }
}

/// Splits a replica into its header and chunks of its bytes, which are shared and not copied.
fn chunks(EncodedReplica { digest, kind, bytes }: EncodedReplica) -> impl Iterator<Item = ReplicaChunk> {
    let header = ReplicaHeader { digest: digest.to_bytes(), kind: kind.into(), length: bytes.len() as u64 };
    let data = (0..bytes.len())
        .step_by(CHUNK_BYTES)
        .map(move |start| Body::Data(bytes.slice(start..bytes.len().min(start + CHUNK_BYTES))));
    std::iter::once(Body::Header(header)).chain(data).map(|body| ReplicaChunk { body: Some(body) })
}
