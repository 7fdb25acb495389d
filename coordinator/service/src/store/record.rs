//! A job as a file: a magic line, a checksum, and a protobuf message.

use std::time::SystemTime;

use prost::Message;
use prost_types::Timestamp;
use protocol::api::{Outcome, SceneOptions, State, SubmitSceneHeader};

use crate::job::{ClientName, JobId, Record, Relit, SceneDigest, Sequence};

/// Record version that this release writes; it reads earlier ones too.
pub const VERSION: u32 = 1;

/// First bytes of every record.
const MAGIC: &[u8] = b"halflight job record\n";

/// Bytes of the checksum: the first of the BLAKE3 digest of the message.
const CHECKSUM: usize = 16;

/// The message. Fields are added, never changed, as in the API.
#[derive(Clone, PartialEq, Message)]
struct Stored {
    #[prost(uint32, tag = "1")]
    version: u32,
    #[prost(string, tag = "2")]
    client: String,
    #[prost(uint64, tag = "3")]
    sequence: u64,
    #[prost(message, optional, tag = "4")]
    header: Option<SubmitSceneHeader>,
    #[prost(bytes = "vec", tag = "5")]
    scene: Vec<u8>,
    #[prost(enumeration = "State", tag = "6")]
    state: i32,
    #[prost(string, tag = "7")]
    failure: String,
    #[prost(message, optional, tag = "8")]
    submitted: Option<Timestamp>,
    #[prost(message, optional, tag = "9")]
    started: Option<Timestamp>,
    #[prost(message, optional, tag = "10")]
    ended: Option<Timestamp>,
    #[prost(message, optional, tag = "11")]
    outcome: Option<Outcome>,
    #[prost(uint64, tag = "12")]
    revision: u64,
    /// Of a relight.
    #[prost(string, tag = "13")]
    baked: String,
    /// Of a relight.
    #[prost(message, optional, tag = "14")]
    options: Option<SceneOptions>,
    #[prost(uint32, tag = "15")]
    crashes: u32,
}

/// Why a record cannot be read.
#[derive(Debug, PartialEq, Eq)]
pub enum RecordError {
    /// It was written by a later release.
    Version {
        /// Its version.
        theirs: u32,
    },
    /// Its bytes have changed.
    Damaged,
}

/// Encodes a record.
pub fn encode(record: &Record) -> Vec<u8> {
    encode_as(record, VERSION)
}

/// Encodes a record under a version.
pub(super) fn encode_as(record: &Record, version: u32) -> Vec<u8> {
    let body = Stored {
        version,
        client: record.client.0.clone(),
        sequence: record.sequence.0,
        header: Some(record.header.clone()),
        scene: record.scene.0.to_vec(),
        state: record.state.into(),
        failure: record.failure.clone(),
        submitted: Some(record.submitted.into()),
        started: record.started.map(Timestamp::from),
        ended: record.ended.map(Timestamp::from),
        outcome: record.outcome.clone(),
        revision: record.revision,
        baked: record.relit.as_ref().map(|relit| relit.baked.to_string()).unwrap_or_default(),
        options: record.relit.as_ref().map(|relit| relit.options.clone()),
        crashes: record.crashes,
    }
    .encode_to_vec();
    [MAGIC, &checksum(&body), &body].concat()
}

/// Decodes a record.
pub fn decode(id: JobId, bytes: &[u8]) -> Result<Record, RecordError> {
    let body = bytes.strip_prefix(MAGIC).and_then(|rest| {
        let (sum, body) = rest.split_first_chunk::<CHECKSUM>()?;
        (checksum(body) == *sum).then_some(body)
    });
    let stored = body.and_then(|body| Stored::decode(body).ok()).ok_or(RecordError::Damaged)?;
    if stored.version > VERSION {
        return Err(RecordError::Version { theirs: stored.version });
    }
    let time = |time: Option<Timestamp>| time.and_then(|time| SystemTime::try_from(time).ok());
    let state = stored.state();
    let relit = match stored.baked.as_str() {
        "" => None,
        baked => {
            let baked = baked.parse().map_err(|_| RecordError::Damaged)?;
            Some(Relit { baked, options: stored.options.unwrap_or_default() })
        }
    };
    Ok(Record {
        id,
        client: ClientName(stored.client),
        sequence: Sequence(stored.sequence),
        header: stored.header.ok_or(RecordError::Damaged)?,
        scene: SceneDigest(stored.scene.try_into().map_err(|_| RecordError::Damaged)?),
        relit,
        state,
        failure: stored.failure,
        submitted: time(stored.submitted).ok_or(RecordError::Damaged)?,
        started: time(stored.started),
        ended: time(stored.ended),
        outcome: stored.outcome,
        revision: stored.revision,
        crashes: stored.crashes,
    })
}

fn checksum(body: &[u8]) -> [u8; CHECKSUM] {
    let digest = *blake3::hash(body).as_bytes();
    // The digest is longer.
    *digest.first_chunk().unwrap_or(&[0; CHECKSUM])
}
