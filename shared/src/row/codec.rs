use bytes::{BufMut, Bytes, BytesMut};

/// Why bytes are not a row.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum RowDecodeError {
    /// The length does not fit the number of receivers and the mask.
    #[error("row of {receivers} receivers has {found} bytes, not {expected}")]
    Length {
        /// Number of receivers that the row should cover.
        receivers: usize,
        /// Length that the mask asks for.
        expected: usize,
        /// Length of the bytes.
        found: usize,
    },
    /// The mask names receivers beyond the last.
    #[error("row of {0} receivers has a factor beyond the last one")]
    BeyondEnd(usize),
    /// A factor is NaN, infinite, negative or a zero that the mask should have left out.
    #[error("row has a factor that is not positive and finite")]
    NotPositive,
}

/// Encodes a row: a bit mask of the receivers whose factor is not 0 (first receiver lowest), then these factors as
/// little-endian f32. A receiver that does not see the shooter costs one bit.
#[must_use]
pub fn encode_row(factors: &[f32]) -> Bytes {
    let visible = factors.iter().filter(|factor| **factor != 0.0).count();
    let mut bytes = BytesMut::with_capacity(factors.len().div_ceil(8) + 4 * visible);
    for eight in factors.chunks(8) {
        let mask =
            eight.iter().enumerate().fold(0, |mask, (i, factor)| mask | (u8::from(*factor != 0.0) << i));
        bytes.put_u8(mask);
    }
    for factor in factors.iter().filter(|factor| **factor != 0.0) {
        bytes.put_f32_le(*factor);
    }
    bytes.freeze()
}

/// Decodes a row of so many receivers, appending its factors.
///
/// # Errors
/// When the bytes cannot have come from [`encode_row`]: nothing is appended then.
pub fn decode_row(bytes: &[u8], receivers: usize, factors: &mut Vec<f32>) -> Result<(), RowDecodeError> {
    let mask_length = receivers.div_ceil(8);
    let (mask, values) = bytes.split_at_checked(mask_length).ok_or(RowDecodeError::Length {
        receivers,
        expected: mask_length,
        found: bytes.len(),
    })?;
    let visible: usize = mask.iter().map(|byte| byte.count_ones() as usize).sum();
    let expected = mask_length + 4 * visible;
    if bytes.len() != expected {
        return Err(RowDecodeError::Length { receivers, expected, found: bytes.len() });
    }
    if !receivers.is_multiple_of(8) && mask.last().is_some_and(|last| last >> (receivers % 8) != 0) {
        return Err(RowDecodeError::BeyondEnd(receivers));
    }
    let (values, _) = values.as_chunks::<4>();
    let mut values = values.iter().map(|value| f32::from_le_bytes(*value));
    if !values.clone().all(|value| value > 0.0 && value.is_finite()) {
        return Err(RowDecodeError::NotPositive);
    }
    factors.reserve(receivers);
    for receiver in 0..receivers {
        let visible = mask[receiver / 8] >> (receiver % 8) & 1 == 1;
        factors.push(if visible { values.next().unwrap_or(0.0) } else { 0.0 });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_row_survives_the_wire(factors in prop::collection::vec(
            prop_oneof![Just(0.0_f32), f32::MIN_POSITIVE..1.0], 0..300)) {
            let mut decoded = vec![];
            decode_row(&encode_row(&factors), factors.len(), &mut decoded).unwrap();
            prop_assert_eq!(decoded, factors);
        }

        #[test]
        fn any_bytes_are_refused_or_encode_to_themselves(
            bytes in prop::collection::vec(any::<u8>(), 0..80), receivers in 0_usize..100) {
            let mut decoded = vec![];
            if decode_row(&bytes, receivers, &mut decoded).is_ok() {
                prop_assert_eq!(decoded.len(), receivers);
                prop_assert_eq!(encode_row(&decoded), bytes);
            } else {
                prop_assert!(decoded.is_empty());
            }
        }
    }

    #[test]
    fn a_receiver_in_the_dark_costs_one_bit() {
        assert_eq!(encode_row(&[0.0; 800]).len(), 100);
        assert_eq!(encode_row(&[0.0, 0.5, 0.0]).as_ref(), [0b010, 0, 0, 0, 0x3f]);
    }
}
