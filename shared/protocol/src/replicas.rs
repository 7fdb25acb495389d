//! A replica in pieces, on its way to a worker: from a coordinator, or from a worker that holds it.

use bytes::Bytes;

use crate::network::Line;
use crate::security::{Credentials, SecuredChannel};
use crate::worker::replica_chunk::Body;
use crate::worker::worker_client::WorkerClient;
use crate::worker::{MAX_MESSAGE_BYTES, ReplicaChunk, ReplicaHeader};

/// Bytes per chunk: large enough to cost nothing, small enough to let other messages through, and to show on a slow link that the
/// upload gets on.
const CHUNK_BYTES: usize = 64 << 10;

/// Splits a replica into its header and chunks of its bytes, which are shared and not copied.
pub fn chunks(header: ReplicaHeader, bytes: Bytes) -> impl Iterator<Item = ReplicaChunk> {
    let data = (0..bytes.len())
        .step_by(CHUNK_BYTES)
        .map(move |start| Body::Data(bytes.slice(start..bytes.len().min(start + CHUNK_BYTES))));
    std::iter::once(Body::Header(header)).chain(data).map(|body| ReplicaChunk { body: Some(body) })
}

/// A caller of a worker.
#[must_use]
pub fn client(channel: Line, credentials: Credentials) -> WorkerClient<SecuredChannel> {
    WorkerClient::with_interceptor(channel, credentials)
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(MAX_MESSAGE_BYTES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_goes_first_and_all_bytes_follow() {
        let bytes: Bytes = (0..CHUNK_BYTES * 2 + 7).map(|byte| byte as u8).collect();
        let header = ReplicaHeader { length: 5, ..ReplicaHeader::default() };
        let mut pieces = chunks(header.clone(), bytes.clone()).map(|chunk| chunk.body.unwrap());
        assert_eq!(pieces.next(), Some(Body::Header(header)));
        let data = pieces.map(|piece| match piece {
            Body::Data(data) => data,
            Body::Header(_) => panic!("a second header"),
        });
        assert_eq!(data.collect::<Vec<_>>().concat(), bytes);
    }
}
