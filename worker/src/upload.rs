//! One replica on its way in: what a header may promise, and what the bytes must keep.

use kernel::replica::{Digest, ReplicaError};
use protocol::packing::unpacked;
use protocol::worker::{ReplicaHeader, ReplicaKind};

use crate::store::{Parcel, Replica};

/// Why an upload is refused.
#[derive(Debug, thiserror::Error)]
pub enum UploadError {
    /// The first chunk is not a header, or a later one is.
    #[error("an upload is one header, then data")]
    Order,
    /// The header's length is beyond what the worker takes.
    #[error(
        "replica {digest} has {length} bytes, this worker takes {largest}: give it more with --replica-bytes"
    )]
    TooLarge {
        /// The replica.
        digest: Digest,
        /// Length in the header.
        length: u64,
        /// Largest length accepted.
        largest: u64,
    },
    /// The bytes are not in the format that the header promised.
    #[error("replica {digest} cannot be unpacked: {cause}")]
    Packing {
        /// The replica.
        digest: Digest,
        /// What is wrong with its bytes.
        cause: String,
    },
    /// More or fewer bytes than the header promised.
    #[error("replica {digest} was announced with {announced} bytes, but {received} came")]
    Length {
        /// The replica.
        digest: Digest,
        /// Length in the header.
        announced: u64,
        /// Bytes that came; the upload is cut off when they become too many.
        received: u64,
    },
    /// The bytes are others than those that the digest was taken of.
    #[error("replica {announced} arrived as {received}: its bytes changed on the way")]
    Digest {
        /// Digest in the header.
        announced: Digest,
        /// Digest of the bytes.
        received: Digest,
    },
    /// The bytes are no replica.
    #[error(transparent)]
    Replica(#[from] ReplicaError),
}

/// A replica of which the header came, and some of the bytes.
#[derive(Debug)]
pub struct Upload {
    digest: Digest,
    kind: ReplicaKind,
    length: u64,
    /// Of the bytes that come, where they are packed.
    packed: Option<u64>,
    bytes: Vec<u8>,
}

impl Upload {
    /// Starts an upload. Nothing is allocated on the header's word alone.
    ///
    /// # Errors
    /// When the header is invalid or announces more than `largest` bytes.
    pub fn begin(header: &ReplicaHeader, largest: u64) -> Result<Self, UploadError> {
        let digest = Digest::try_from(header.digest.as_ref())?;
        let length = header.length;
        if length > largest {
            return Err(UploadError::TooLarge { digest, length, largest });
        }
        // What is packed is shorter than the message.
        let packed = Some(header.packed_length).filter(|packed| *packed > 0);
        if let Some(packed) = packed.filter(|packed| *packed >= length) {
            return Err(UploadError::Length { digest, announced: length, received: packed });
        }
        Ok(Self { digest, kind: header.kind(), length, packed, bytes: vec![] })
    }

    /// Name of the replica.
    #[must_use]
    pub fn digest(&self) -> Digest {
        self.digest
    }

    /// Announced length in bytes.
    #[must_use]
    pub fn length(&self) -> u64 {
        self.length
    }

    /// Takes the next bytes.
    ///
    /// # Errors
    /// When they are more than the header announced.
    pub fn push(&mut self, data: &[u8]) -> Result<(), UploadError> {
        let received = (self.bytes.len() + data.len()) as u64;
        if received > self.coming() {
            return Err(UploadError::Length { digest: self.digest, announced: self.coming(), received });
        }
        self.bytes.extend_from_slice(data);
        Ok(())
    }

    /// Bytes that come in all.
    fn coming(&self) -> u64 {
        self.packed.unwrap_or(self.length)
    }

    /// Checks the bytes against length and digest and makes the replica ready.
    ///
    /// # Errors
    /// When bytes are missing, were changed, or are not a replica.
    pub fn finish(self) -> Result<Replica, UploadError> {
        self.finish_and_keep().map(|(replica, _)| replica)
    }

    /// As [`Self::finish`], with the bytes as they came.
    ///
    /// # Errors
    /// As for [`Self::finish`].
    pub fn finish_and_keep(mut self) -> Result<(Replica, Parcel), UploadError> {
        let is_complete = |announced: u64, bytes: &[u8]| {
            let received = bytes.len() as u64;
            let digest = self.digest;
            if received == announced {
                Ok(())
            } else {
                Err(UploadError::Length { digest, announced, received })
            }
        };
        is_complete(self.coming(), &self.bytes)?;
        let unpacked = match self.packed {
            Some(_) => unpacked(&self.bytes, self.length)
                .map(Some)
                .map_err(|error| UploadError::Packing { digest: self.digest, cause: error.to_string() })?,
            None => None,
        };
        let bytes = unpacked.as_deref().unwrap_or(&self.bytes);
        is_complete(self.length, bytes)?;
        let received = Digest::of(bytes);
        if received != self.digest {
            return Err(UploadError::Digest { announced: self.digest, received });
        }
        let replica = Replica::decode(self.kind, bytes)?;
        let header = ReplicaHeader {
            digest: self.digest.to_bytes(),
            kind: self.kind.into(),
            length: self.length,
            packed_length: self.packed.unwrap_or(0),
            passed_to: 0,
        };
        // It stays as long as the replica.
        self.bytes.shrink_to_fit();
        Ok((replica, Parcel { header, bytes: self.bytes.into() }))
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use kernel::geometry::PlaneId;
    use kernel::replica::{EncodedReplica, Receiver, Receivers, encode_receivers};
    use protocol::packing::packed;

    use super::*;

    fn encoded() -> EncodedReplica {
        encode_receivers(&Receivers { first_key: 300, receivers: vec![] })
    }

    fn header(replica: &EncodedReplica) -> ReplicaHeader {
        ReplicaHeader {
            digest: replica.digest.to_bytes(),
            kind: replica.kind.into(),
            length: replica.bytes.len() as u64,
            packed_length: 0,
            passed_to: 0,
        }
    }

    #[test]
    fn a_packed_replica_is_unpacked_and_checked() {
        let receiver =
            |x: usize| Receiver { position: DVec3::X * x as f64, normal: DVec3::Y, plane: PlaneId(0) };
        let receivers = (0..1000).map(receiver).collect();
        let replica = encode_receivers(&Receivers { first_key: 300, receivers });
        let bytes = packed(&replica.bytes).unwrap();
        let announced = |packed_length| ReplicaHeader { packed_length, ..header(&replica) };
        let sent = |packed_length, bytes: &[u8]| {
            let mut upload = Upload::begin(&announced(packed_length), 1 << 20)?;
            upload.push(bytes)?;
            upload.finish()
        };
        let length = bytes.len() as u64;
        assert!(matches!(sent(length, &bytes).unwrap(), Replica::Receivers(set) if set.first_key == 300));
        assert!(matches!(sent(length - 1, &bytes), Err(UploadError::Length { .. })));
        assert!(matches!(sent(length, &bytes[1..]), Err(UploadError::Length { .. })));
        assert!(matches!(sent(length, &vec![7; bytes.len()]), Err(UploadError::Packing { .. })));
        assert!(matches!(sent(u64::MAX, &bytes), Err(UploadError::Length { .. })));
        let bomb = packed(&vec![0; 1 << 22]).unwrap();
        assert!(matches!(sent(bomb.len() as u64, &bomb), Err(UploadError::Length { .. })));
        let other = packed(&vec![0; replica.bytes.len()]).unwrap();
        assert!(matches!(sent(other.len() as u64, &other), Err(UploadError::Digest { .. })));
    }

    #[test]
    fn a_replica_in_pieces_is_put_together() {
        let replica = encoded();
        let mut upload = Upload::begin(&header(&replica), 100).unwrap();
        for byte in replica.bytes.chunks(1) {
            upload.push(byte).unwrap();
        }
        assert!(matches!(upload.finish().unwrap(), Replica::Receivers(set) if set.first_key == 300));
    }

    #[test]
    fn a_header_beyond_the_limit_is_refused_before_any_byte() {
        let replica = encoded();
        let announced = ReplicaHeader { length: u64::MAX, ..header(&replica) };
        assert!(matches!(Upload::begin(&announced, 1 << 30), Err(UploadError::TooLarge { .. })));
    }

    #[test]
    fn bytes_other_than_announced_are_refused() {
        let replica = encoded();
        let mut too_many = Upload::begin(&header(&replica), 100).unwrap();
        too_many.push(&replica.bytes).unwrap();
        assert!(matches!(too_many.push(&[0]), Err(UploadError::Length { .. })));

        let mut too_few = Upload::begin(&header(&replica), 100).unwrap();
        too_few.push(&replica.bytes[1..]).unwrap();
        assert!(matches!(too_few.finish(), Err(UploadError::Length { .. })));

        let mut changed = Upload::begin(&header(&replica), 100).unwrap();
        changed.push(&vec![0; replica.bytes.len()]).unwrap();
        assert!(matches!(changed.finish(), Err(UploadError::Digest { .. })));
    }
}
