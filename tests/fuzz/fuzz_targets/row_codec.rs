//! Bytes that decode to a row are what encoding makes of it; all others are refused.
#![no_main]

use kernel::row::{Row, decode_row, encode_row};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: (u16, &[u8])| {
    let (receivers, bytes) = (usize::from(input.0), input.1);
    let Ok(row) = decode_row(bytes, receivers) else { return };
    assert_eq!(row.receivers(), receivers);
    let factors = row.to_dense();
    assert_eq!(factors.len(), receivers);
    assert!(factors.iter().all(|factor| factor.is_finite() && *factor >= 0.0));
    assert_eq!(Row::new(&factors), row);
    assert_eq!(encode_row(&row), bytes);
});
