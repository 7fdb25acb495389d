use bytes::{Buf, BufMut, Bytes, BytesMut};
use prost::encoding::{decode_varint, encode_varint, encoded_len_varint};

use super::Row;
use super::sparse::{GROUP, Group};

/// Why bytes are not a row.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum RowDecodeError {
    /// The bytes end too early, or go on after the last factor.
    #[error("row of {0} bytes is longer or shorter than its groups")]
    Length(usize),
    /// The groups name receivers beyond the last.
    #[error("row of {0} receivers has a factor beyond the last one")]
    BeyondEnd(usize),
    /// A group has no receiver, or a number is written longer than it needs to be.
    #[error("row has an empty group or a number that is too long")]
    NotShortest,
    /// A factor is NaN, infinite, negative or a zero that the groups should have left out.
    #[error("row has a factor that is not positive and finite")]
    NotPositive,
}

/// Encodes a row. Receivers stand in groups of 32; groups without a factor that is not 0 are left out:
///
/// 1. the number of groups, a varint as in protobuf;
/// 2. for each group the number of groups left out before it, a varint; then its mask, a little-endian u32 with a bit for each
///    receiver that has a factor, the first receiver's lowest;
/// 3. these factors, as little-endian f32.
///
/// A receiver among others that see the shooter costs 4 bytes, and one in the dark between them a bit and a quarter. A dark
/// room costs nothing.
#[must_use]
pub fn encode_row(row: &Row) -> Bytes {
    let mut bytes = BytesMut::with_capacity(8 + 6 * row.groups.len() + 4 * row.factors.len());
    encode_varint(row.groups.len() as u64, &mut bytes);
    let mut next = 0;
    for group in &row.groups {
        encode_varint(u64::from(group.index - next), &mut bytes);
        bytes.put_u32_le(group.mask);
        next = group.index + 1;
    }
    row.factors.iter().for_each(|factor| bytes.put_f32_le(*factor));
    bytes.freeze()
}

/// Decodes a row of so many receivers.
///
/// # Errors
/// When the bytes cannot have come from [`encode_row`].
pub fn decode_row(bytes: &[u8], receivers: usize) -> Result<Row, RowDecodeError> {
    let length = || RowDecodeError::Length(bytes.len());
    let mut rest = bytes;
    let count = shortest_varint(&mut rest).ok_or_else(length)??;
    // A group takes five bytes or more, and a factor four: what the bytes claim is held against their length before any
    // memory is taken.
    if count > rest.len() as u64 / 9 {
        return Err(length());
    }
    let mut groups = Vec::with_capacity(count as usize);
    let mut next = 0_u64;
    for _ in 0..count {
        let index = next.saturating_add(shortest_varint(&mut rest).ok_or_else(length)??);
        if rest.len() < size_of::<u32>() {
            return Err(length());
        }
        let mask = rest.get_u32_le();
        if mask == 0 {
            return Err(RowDecodeError::NotShortest);
        }
        let last = index.saturating_mul(GROUP as u64).saturating_add(u64::from(mask.ilog2()));
        if last >= receivers as u64 || index > u64::from(u32::MAX) {
            return Err(RowDecodeError::BeyondEnd(receivers));
        }
        groups.push(Group { index: index as u32, mask });
        next = index + 1;
    }
    let visible: usize = groups.iter().map(|group| group.mask.count_ones() as usize).sum();
    let (values, remainder) = rest.as_chunks::<4>();
    if values.len() != visible || !remainder.is_empty() {
        return Err(length());
    }
    let factors: Vec<f32> = values.iter().map(|value| f32::from_le_bytes(*value)).collect();
    if !factors.iter().all(|value| *value > 0.0 && value.is_finite()) {
        return Err(RowDecodeError::NotPositive);
    }
    Ok(Row::from_parts(receivers, groups, factors))
}

/// A number that is written as [`encode_varint`] writes it; `None` where the bytes end before it does.
fn shortest_varint(rest: &mut &[u8]) -> Option<Result<u64, RowDecodeError>> {
    let before = rest.len();
    let value = decode_varint(rest).ok()?;
    let is_shortest = encoded_len_varint(value) == before - rest.len();
    Some(if is_shortest { Ok(value) } else { Err(RowDecodeError::NotShortest) })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_row_survives_the_wire(
            dark in 0_usize..5000,
            factors in prop::collection::vec(prop_oneof![Just(0.0_f32), f32::MIN_POSITIVE..1.0], 0..300)) {
            let factors = [vec![0.0; dark], factors, vec![0.0; dark / 2]].concat();
            let row = Row::new(&factors);
            prop_assert_eq!(decode_row(&encode_row(&row), factors.len()), Ok(row));
        }

        #[test]
        fn any_bytes_are_refused_or_encode_to_themselves(
            bytes in prop::collection::vec(any::<u8>(), 0..80), receivers in 0_usize..100) {
            if let Ok(row) = decode_row(&bytes, receivers) {
                prop_assert_eq!(row.receivers(), receivers);
                prop_assert_eq!(encode_row(&row), bytes);
            }
        }

        /// Most random bytes are refused at once: these are rows but for one byte.
        #[test]
        fn a_damaged_row_is_refused_or_another_row(
            factors in prop::collection::vec(prop_oneof![Just(0.0_f32), 0.1_f32..1.0], 1..200),
            place in any::<prop::sample::Index>(), byte in any::<u8>()) {
            let mut bytes = encode_row(&Row::new(&factors)).to_vec();
            let place = place.index(bytes.len());
            bytes[place] = byte;
            if let Ok(row) = decode_row(&bytes, factors.len()) {
                prop_assert_eq!(encode_row(&row), bytes);
            }
        }
    }

    #[test]
    fn what_is_in_the_dark_costs_nothing() {
        assert_eq!(encode_row(&Row::new(&[0.0; 100_000])).as_ref(), [0]);
        let mut factors = vec![0.0; 100_000];
        factors[40] = 0.5;
        // One group, one left out before it, bit 8, one half.
        assert_eq!(encode_row(&Row::new(&factors)).as_ref(), [1, 1, 0, 1, 0, 0, 0, 0, 0, 0x3f]);
    }

    #[test]
    fn bytes_that_no_row_encodes_to_are_refused() {
        let half = 0.5_f32.to_le_bytes();
        let row = |count: &[u8], gap: &[u8], mask: u32, factors: &[u8]| {
            decode_row(&[count, gap, &mask.to_le_bytes(), factors].concat(), 40)
        };
        assert_eq!(row(&[1], &[1], 1 << 7, &half).unwrap().factor(39), 0.5);
        assert_eq!(row(&[1], &[1], 1 << 8, &half), Err(RowDecodeError::BeyondEnd(40)));
        assert_eq!(row(&[1], &[2], 1, &half), Err(RowDecodeError::BeyondEnd(40)));
        assert_eq!(row(&[1], &[0], 0, &half), Err(RowDecodeError::NotShortest));
        assert_eq!(row(&[0x81, 0], &[0], 1, &half), Err(RowDecodeError::NotShortest));
        assert_eq!(row(&[1], &[0x80, 0], 1, &half), Err(RowDecodeError::NotShortest));
        assert_eq!(row(&[1], &[0], 3, &half), Err(RowDecodeError::Length(10)));
        assert_eq!(row(&[1], &[0], 1, &[half, half].concat()), Err(RowDecodeError::Length(14)));
        assert_eq!(row(&[2], &[0], 1, &half), Err(RowDecodeError::Length(10)));
        for wrong in [0.0, -0.5, f32::NAN, f32::INFINITY] {
            assert_eq!(row(&[1], &[0], 1, &wrong.to_le_bytes()), Err(RowDecodeError::NotPositive));
        }
        assert_eq!(decode_row(&[], 40), Err(RowDecodeError::Length(0)));
        assert_eq!(decode_row(&[0xff; 11], 40), Err(RowDecodeError::Length(11)));
    }
}
