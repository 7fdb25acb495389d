//! A replica on its way to a worker.

use std::time::Duration;

use kernel::replica::{Digest, EncodedReplica};
use protocol::security::SecuredChannel;
use protocol::worker::replica_chunk::Body;
use protocol::worker::worker_client::WorkerClient;
use protocol::worker::{LoadReplicaReply, ReplicaChunk, ReplicaHeader};
use tokio::time::timeout;

use super::error::{is_refusal, words};

/// Bytes in one chunk: large enough to cost nothing, small enough that other messages get in between.
const CHUNK_BYTES: usize = 256 << 10;

/// An upload may take so long, and a second more for each [`SLOWEST_BYTES`].
const UPLOAD_TIMEOUT: Duration = Duration::from_secs(60);
const SLOWEST_BYTES: u64 = 100_000;

/// Why a replica is not on a worker.
#[derive(Debug, thiserror::Error)]
pub(super) enum UploadFailure {
    /// The worker itself says no, or says something that cannot be: it would do so again.
    #[error("{0}")]
    Refused(String),
    /// The connection failed.
    #[error("{0}")]
    Broken(String),
}

/// Loads a replica to a worker; ends when the worker can use it.
pub(super) async fn upload(
    mut client: WorkerClient<SecuredChannel>,
    replica: EncodedReplica,
) -> (Digest, Result<(), UploadFailure>) {
    let digest = replica.digest;
    let limit = UPLOAD_TIMEOUT + Duration::from_secs(replica.bytes.len() as u64 / SLOWEST_BYTES);
    let loading = client.load_replica(tokio_stream::iter(chunks(replica)));
    let result = match timeout(limit, loading).await {
        Err(_) => Err(UploadFailure::Broken(format!("it took more than {} s", limit.as_secs()))),
        Ok(Err(status)) if is_refusal(&status) => Err(UploadFailure::Refused(words(&status))),
        Ok(Err(status)) => Err(UploadFailure::Broken(words(&status))),
        Ok(Ok(reply)) => check(digest, reply.get_ref()),
    };
    (digest, result)
}

/// Holds the worker's digest of what it holds against the one that it was sent.
fn check(digest: Digest, reply: &LoadReplicaReply) -> Result<(), UploadFailure> {
    match Digest::try_from(reply.digest.as_ref()) {
        Ok(theirs) if theirs == digest => {
            tracing::debug!(replica = %digest, already_held = reply.already_held, "replica loaded");
            Ok(())
        }
        Ok(theirs) => Err(UploadFailure::Refused(format!("it says that it holds replica {theirs}"))),
        Err(error) => Err(UploadFailure::Refused(error.to_string())),
    }
}

/// The header, then the bytes, which are shared and not copied.
fn chunks(EncodedReplica { digest, kind, bytes }: EncodedReplica) -> impl Iterator<Item = ReplicaChunk> {
    let header = ReplicaHeader { digest: digest.to_bytes(), kind: kind.into(), length: bytes.len() as u64 };
    let data = (0..bytes.len())
        .step_by(CHUNK_BYTES)
        .map(move |start| Body::Data(bytes.slice(start..bytes.len().min(start + CHUNK_BYTES))));
    std::iter::once(Body::Header(header)).chain(data).map(|body| ReplicaChunk { body: Some(body) })
}
