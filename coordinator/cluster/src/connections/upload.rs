//! Sends a replica to a worker.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use bytes::Bytes;
use kernel::replica::{Digest, EncodedReplica};
use protocol::packing::packed;
use protocol::replicas::chunks;
use protocol::security::SecuredChannel;
use protocol::worker::worker_client::WorkerClient;
use protocol::worker::{LoadReplicaReply, ReplicaHeader};
use tokio::task::spawn_blocking;
use tokio::time::timeout;

use super::error::{is_refusal, is_refusal_of_replica, words};

/// From this number of bytes on packing takes so long that the threads that move messages leave it to others.
const MUCH_TO_PACK: usize = 1 << 18;

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

/// A replica, and the same packed once a worker elsewhere needed it: all others get the same bytes.
#[derive(Debug)]
pub(super) struct Published {
    pub(super) replica: EncodedReplica,
    packed: OnceLock<Option<Bytes>>,
}

impl Published {
    pub(super) fn new(replica: EncodedReplica) -> Self {
        Self { replica, packed: OnceLock::new() }
    }

    /// The replica packed, where that is shorter.
    fn packed(&self) -> Option<Bytes> {
        self.packed.get_or_init(|| packed(&self.replica.bytes).map(Bytes::from)).clone()
    }
}

/// A replica on its way to a worker.
pub(super) struct Parcel {
    published: Arc<Published>,
    packed: Option<Bytes>,
}

impl Parcel {
    /// Length of what is sent.
    pub(super) fn len(&self) -> usize {
        self.packed.as_ref().unwrap_or(&self.published.replica.bytes).len()
    }
}

/// Packs a replica for a worker, if it is `remote`. What was begun is kept for the next one, even if nobody waits for it any more.
pub(super) async fn pack(published: Arc<Published>, remote: bool) -> Parcel {
    let packed = if !remote {
        None
    } else if published.replica.bytes.len() < MUCH_TO_PACK {
        published.packed()
    } else {
        let own = Arc::clone(&published);
        // It goes as it is where the runtime ends.
        spawn_blocking(move || own.packed()).await.ok().flatten()
    };
    Parcel { published, packed }
}

/// Sends a replica to a worker. Ends when the worker can use it.
pub(super) async fn upload(
    mut client: WorkerClient<SecuredChannel>,
    Parcel { published, packed }: Parcel,
) -> (Digest, Result<(), UploadFailure>) {
    let replica = &published.replica;
    let digest = replica.digest;
    let limit = UPLOAD_TIMEOUT + Duration::from_secs(replica.bytes.len() as u64 / SLOWEST_BYTES);
    let header = ReplicaHeader {
        digest: digest.to_bytes(),
        kind: replica.kind.into(),
        length: replica.bytes.len() as u64,
        packed_length: packed.as_ref().map_or(0, |packed| packed.len() as u64),
        passed_to: 0,
    };
    let bytes = packed.unwrap_or_else(|| replica.bytes.clone());
    let loading = client.load_replica(tokio_stream::iter(chunks(header, bytes)));
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
