//! Replicas compressed for their way to workers: planes and normals repeat, and so do coordinates on a plane. A replica takes a fifth
//! of its length, and its digest is that of the message unpacked.

use std::io::{Error, Read, Write};

use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;

/// Messages shorter than this go as they are.
const LEAST_BYTES: usize = 4 << 10;

/// The message in zlib format; `None` where that would not be shorter by an eighth.
#[must_use]
pub fn packed(message: &[u8]) -> Option<Vec<u8>> {
    if message.len() < LEAST_BYTES {
        return None;
    }
    let mut encoder = ZlibEncoder::new(Vec::with_capacity(message.len() / 4), Compression::fast());
    encoder.write_all(message).ok()?;
    let packed = encoder.finish().ok()?;
    (packed.len() < message.len() - message.len() / 8).then_some(packed)
}

/// The message that was packed. No more than `length` bytes are unpacked, and one more where there are more.
///
/// # Errors
/// When the bytes are not in zlib format.
pub fn unpacked(packed: &[u8], length: u64) -> Result<Vec<u8>, Error> {
    let mut message = vec![];
    ZlibDecoder::new(packed).take(length.saturating_add(1)).read_to_end(&mut message)?;
    Ok(message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_comes_as_it_went_and_never_longer() {
        let message: Vec<u8> = (0..100_000_u32).flat_map(|i| f64::from(i % 100).to_le_bytes()).collect();
        let packed = packed(&message).unwrap();
        assert!(packed.len() < message.len() / 4);
        assert_eq!(unpacked(&packed, message.len() as u64).unwrap(), message);
        assert_eq!(unpacked(&packed, 1000).unwrap(), message[..1001], "a bomb does not go off");
        assert!(unpacked(&message, 1000).is_err());
    }

    #[test]
    fn what_does_not_become_shorter_stays() {
        assert_eq!(packed(&[0; 100]), None);
        let noise: Vec<u8> =
            (0..10_000_u64).map(|i| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 56) as u8).collect();
        let noise: Vec<u8> = noise
            .iter()
            .scan(1_u64, |x, byte| {
                *x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(u64::from(*byte) | 1);
                Some((*x >> 56) as u8)
            })
            .collect();
        assert_eq!(packed(&noise), None);
    }
}
