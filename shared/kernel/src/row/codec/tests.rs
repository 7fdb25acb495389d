use proptest::prelude::*;

use super::*;

/// Factors as they come: none, rounded ones of some exponents, any that there are.
fn factor() -> impl Strategy<Value = f32> {
    let rounded = (0x38_0000_u32 >> 10..0x3f80_0000 >> 10).prop_map(|code| f32::from_bits(code << 10));
    let any = (1..INFINITE).prop_map(f32::from_bits);
    prop_oneof![3 => Just(0.0_f32), 6 => 1e-4_f32..1e-3, 3 => rounded, 1 => any]
}

fn row() -> impl Strategy<Value = Row> {
    (0_usize..5000, prop::collection::vec(factor(), 0..300))
        .prop_map(|(dark, factors)| Row::new(&[vec![0.0; dark], factors, vec![0.0; dark / 2]].concat()))
}

proptest! {
    #[test]
    fn a_row_survives_the_wire(row in row()) {
        let bytes = encode_row(&row);
        prop_assert!(bytes.len() as u64 <= longest_encoded_row(row.receivers() as u32));
        prop_assert_eq!(decode_row(&bytes, row.receivers()), Ok(row));
    }

    #[test]
    fn any_bytes_are_refused_or_encode_to_themselves(
        bytes in prop::collection::vec(any::<u8>(), 0..80), receivers in 0_usize..100) {
        if let Ok(row) = decode_row(&bytes, receivers) {
            prop_assert_eq!(row.receivers(), receivers);
            prop_assert_eq!(encode_row(&row), bytes);
        }
    }

    /// Most random bytes are refused at once: these are rows but for one bit.
    #[test]
    fn a_damaged_row_is_refused_or_another_row(
        row in row(), place in any::<prop::sample::Index>(), bit in 0_u32..8, cut in any::<bool>()) {
        let mut bytes = encode_row(&row).to_vec();
        prop_assume!(!bytes.is_empty());
        let place = place.index(bytes.len());
        if cut {
            bytes.truncate(place);
        } else {
            bytes[place] ^= 1_u8 << bit;
        }
        if let Ok(other) = decode_row(&bytes, row.receivers()) {
            prop_assert_ne!(&other, &row);
            prop_assert_eq!(encode_row(&other), bytes);
        }
    }
}

/// A string of bits as it is read: each part with its width.
fn string(parts: &[(u32, u32)]) -> Vec<u8> {
    let mut writer = BitWriter::with_capacity(0);
    parts.iter().for_each(|(value, width)| writer.put(*value, *width));
    writer.finish()
}

/// One half has 24 trailing zeros and the bits 111111 before them.
const HALF: (u32, u32) = (0b11_1111, FACTOR_BITS - 24);

/// Shift 24, no group left out, a mask whose first byte has this value, width 0.
fn one_group(byte: u32) -> Vec<(u32, u32)> {
    vec![(24, 5), (1, 1), (0b0001, 4), (byte, 8), (0, 5), HALF]
}

#[test]
fn what_is_in_the_dark_costs_nothing() {
    assert!(encode_row(&Row::new(&[0.0; 100_000])).is_empty());
    let mut factors = vec![0.0; 100_000];
    factors[40] = 0.5;
    // One group left out (2 in gamma code: 0, 1, 0), and bit 8: the first byte is no longer full, the second has a bit.
    let expected = string(&[(24, 5), (0b010, 3), (0b0011, 4), (0, 8), (1, 8), (0, 5), HALF]);
    assert_eq!(encode_row(&Row::new(&factors)), expected);
}

#[test]
fn factors_of_one_octave_take_their_digits() {
    // Factors of one octave, rounded to 13 bits.
    let factors: Vec<f32> =
        (0..3200).map(|i| f32::from_bits(0x3c00_0000 + ((i * 7919 % 8192) << 10))).collect();
    let bytes = encode_row(&Row::new(&factors)).len();
    // Gap and tags 5 bits, the width 5, the least factor 31 - 10 - (13 - 3) = 11.
    assert!(bytes * 8 <= 3200 * 13 + 100 * (5 + 5 + 11) + 5 + 7 + 3200 / 8, "{bytes}");
}

#[test]
fn bytes_that_no_row_encodes_to_are_refused() {
    let decode = |parts: &[(u32, u32)]| decode_row(&string(parts), 40);
    let good = decode(&one_group(1)).unwrap();
    assert_eq!((good.factor(0), good.count()), (0.5, 1));
    let with = |place: usize, part: (u32, u32)| {
        let mut parts = one_group(1);
        parts[place] = part;
        decode(&parts)
    };
    // A factor at a receiver that is not there: receiver 40 is bit 8 of the group after one left out.
    let after =
        |mask: &[(u32, u32)]| decode(&[&[(24, 5), (0b010, 3)][..], mask, &[(0, 5), HALF][..]].concat());
    assert_eq!(after(&[(0b0001, 4), (0x80, 8)]), Err(RowDecodeError::BeyondEnd(40)), "repeated to the end");
    assert_eq!(after(&[(0b0011, 4), (0, 8), (1, 8)]), Err(RowDecodeError::BeyondEnd(40)));
    assert_eq!(after(&[(0b0001, 4), (1, 8)]).unwrap().factor(32), 0.5);
    assert_eq!(with(1, (0b00100, 5)), Err(RowDecodeError::BeyondEnd(40)), "three groups left out");
    // Masks: empty, or with a byte that need not be there.
    assert_eq!(with(3, (0, 8)), Err(RowDecodeError::NotShortest));
    assert_eq!(with(3, (0xff, 8)), Err(RowDecodeError::NotShortest));
    // Factors with trailing zeros, a width that is not needed, one beyond all factors.
    let even = [(23, 5), (1, 1), (1, 4), (1, 8), (0, 5), (HALF.0 << 1, HALF.1 + 1)];
    assert_eq!(decode(&even), Err(RowDecodeError::NotShortest));
    let wide = [(24, 5), (1, 1), (1, 4), (1, 8), (1, 5), HALF, (0, 1)];
    assert_eq!(decode(&wide), Err(RowDecodeError::NotShortest));
    assert_eq!(with(4, (8, 5)), Err(RowDecodeError::NotShortest));
    // 0, infinity, NaN.
    assert_eq!(with(5, (0, HALF.1)), Err(RowDecodeError::NotPositive));
    for wrong in [f32::INFINITY, f32::NAN] {
        let parts = [(0, 5), (1, 1), (1, 4), (1, 8), (0, 5), (wrong.to_bits(), FACTOR_BITS)];
        assert_eq!(decode(&parts), Err(RowDecodeError::NotPositive), "{wrong}");
    }
    assert_eq!(with(0, (31, 5)), Err(RowDecodeError::NotPositive));
    // Too long, too short, nothing but a shift.
    let bytes = string(&one_group(1));
    assert_eq!(decode_row(&[&bytes[..], &[0]].concat(), 40), Err(RowDecodeError::Length(bytes.len() + 1)));
    assert_eq!(decode_row(&bytes[..bytes.len() - 1], 40), Err(RowDecodeError::Length(bytes.len() - 1)));
    assert_eq!(decode_row(&[0], 40), Err(RowDecodeError::NotShortest));
    assert_eq!(decode_row(&[0; 9], 40), Err(RowDecodeError::Length(9)));
    assert_eq!(decode_row(&[0xff; 11], 40), Err(RowDecodeError::NotPositive));
}

#[test]
#[should_panic(expected = "factors are positive and finite")]
fn a_negative_factor_is_not_sent() {
    let _ = encode_row(&Row::new(&[-0.5]));
}
