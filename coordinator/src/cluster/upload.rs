//! A replica on its way to a worker.

use shared::protocol::replica_chunk::Body;
use shared::protocol::worker_client::WorkerClient;
use shared::protocol::{ReplicaChunk, ReplicaHeader};
use shared::replica::{Digest, EncodedReplica};
use tonic::Status;
use tonic::transport::Channel;

/// Bytes in one chunk: large enough to cost nothing, small enough that other messages get in between.
const CHUNK_BYTES: usize = 256 << 10;

/// Loads a replica to a worker; ends when the worker can use it.
pub(super) async fn upload(
    mut client: WorkerClient<Channel>,
    replica: EncodedReplica,
) -> (Digest, Result<(), Status>) {
    let digest = replica.digest;
    let loaded = client.load_replica(tokio_stream::iter(chunks(replica))).await;
    if let Ok(reply) = &loaded {
        tracing::debug!(replica = %digest, already_held = reply.get_ref().already_held, "replica loaded");
    }
    (digest, loaded.map(|_| ()))
}

/// The header, then the bytes, which are shared and not copied.
fn chunks(EncodedReplica { digest, kind, bytes }: EncodedReplica) -> impl Iterator<Item = ReplicaChunk> {
    let header = ReplicaHeader { digest: digest.to_bytes(), kind: kind.into(), length: bytes.len() as u64 };
    let data = (0..bytes.len())
        .step_by(CHUNK_BYTES)
        .map(move |start| Body::Data(bytes.slice(start..bytes.len().min(start + CHUNK_BYTES))));
    std::iter::once(Body::Header(header)).chain(data).map(|body| ReplicaChunk { body: Some(body) })
}
