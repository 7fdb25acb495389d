//! Bytes that decode to a row are what encoding makes of it; all others are refused and leave nothing behind.
#![no_main]

use libfuzzer_sys::fuzz_target;
use shared::row::{decode_row, encode_row};

fuzz_target!(|input: (u16, &[u8])| {
    let (receivers, bytes) = (usize::from(input.0), input.1);
    let mut row = vec![];
    if decode_row(bytes, receivers, &mut row).is_err() {
        assert!(row.is_empty());
        return;
    }
    assert_eq!(row.len(), receivers);
    assert!(row.iter().all(|factor| factor.is_finite() && *factor >= 0.0));
    assert_eq!(encode_row(&row), bytes);
});
