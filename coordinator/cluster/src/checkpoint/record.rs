//! Encoding of one row in the file: length, key, cost, the encoded row, and a checksum.

use kernel::replica::Digest;
use kernel::row::{Row, RowRequest, Shooter, decode_row, encode_row};
use prost::Message;
use prost::bytes::{Buf, BufMut};
use protocol::worker::RowStatistics;

/// Bytes before a record's body: its length as a little-endian u32, and the key.
pub const HEAD: usize = size_of::<u32>() + size_of::<Digest>();

/// Bytes after it: the start of the BLAKE3 digest of key and body.
pub const TAIL: usize = 8;

/// Longest row in bytes; no worker could send a longer one.
pub const LONGEST: usize = protocol::worker::MAX_MESSAGE_BYTES;

/// Digests of all that each row of a request depends on.
pub fn keys(request: &RowRequest) -> Vec<Digest> {
    let RowRequest { scene, receivers, first_receiver, receiver_count, precision, ref shooters } = *request;
    let common = RowRequest { scene, receivers, first_receiver, receiver_count, precision, shooters: vec![] };
    let common = common.to_job(0).encode_length_delimited_to_vec();
    let mut hasher = blake3::Hasher::new();
    hasher.update(&common);
    let key = |shooter: &Shooter| {
        let mut hasher = hasher.clone();
        hasher.update(&shooter.to_message().encode_to_vec());
        Digest(*hasher.finalize().as_bytes())
    };
    shooters.iter().map(key).collect()
}

/// Encodes a record.
pub fn encode(key: Digest, row: &Row, statistics: &RowStatistics) -> Vec<u8> {
    let row = encode_row(row);
    let mut bytes = Vec::with_capacity(HEAD + statistics.encoded_len() + row.len() + TAIL + 4);
    bytes.put_u32_le(0);
    bytes.put_slice(&key.0);
    bytes.put_slice(&statistics.encode_length_delimited_to_vec());
    bytes.put_slice(&row);
    let length = (bytes.len() - HEAD) as u32;
    bytes[..size_of::<u32>()].copy_from_slice(&length.to_le_bytes());
    let checksum = checksum(&bytes[size_of::<u32>()..]);
    bytes.put_slice(&checksum);
    bytes
}

/// Decodes the head of a record into key and length of the body; `None` if it is not one.
pub fn decode_head(head: &[u8; HEAD]) -> Option<(Digest, usize)> {
    let (length, key) = head.split_first_chunk()?;
    let length = u32::from_le_bytes(*length) as usize;
    Some((Digest::try_from(key).ok()?, length)).filter(|_| length <= LONGEST)
}

/// Whether a body with its checksum belongs to this key.
pub fn is_whole(key: Digest, body_and_tail: &[u8]) -> bool {
    let Some((body, tail)) = body_and_tail.split_last_chunk::<TAIL>() else { return false };
    let mut hasher = blake3::Hasher::new();
    hasher.update(&key.0).update(body);
    hasher.finalize().as_bytes()[..TAIL] == *tail
}

/// Decodes the row in a body that [`is_whole`]; `None` if it has another number of receivers.
pub fn decode_body(body_and_tail: &[u8], receivers: usize) -> Option<(Row, RowStatistics)> {
    let (mut body, _) = body_and_tail.split_last_chunk::<TAIL>()?;
    let statistics = RowStatistics::decode_length_delimited(&mut body).ok()?;
    Some((decode_row(body.chunk(), receivers).ok()?, statistics))
}

fn checksum(key_and_body: &[u8]) -> [u8; TAIL] {
    let digest = *blake3::hash(key_and_body).as_bytes();
    // The digest is longer.
    *digest.first_chunk().unwrap_or(&[0; TAIL])
}
