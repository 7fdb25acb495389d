//! Bad numbers.

use serde_json::Value;

use crate::builder::pack;
use crate::numbers::Numbers;

/// Values that floats of a buffer must not have, or hardly.
const FLOATS: [f32; 10] = [
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MAX,
    f32::MIN,
    1e38,
    1e20,
    f32::MIN_POSITIVE,
    1e-45,
    -0.0,
];

/// Numbers for a document.
const NUMBERS: [&str; 14] = [
    "0",
    "-1",
    "1e38",
    "-1e38",
    "1e300",
    "1e-300",
    "1e-45",
    "0.5",
    "3",
    "255",
    "65536",
    "4294967295",
    "18446744073709551615",
    "-0.0",
];

/// The bytes of a GLB, with some numbers of its document or its buffer damaged.
pub(super) fn damaged(document: Value, mut binary: Vec<u8>, numbers: &mut Numbers) -> Vec<u8> {
    let mut document = document;
    for _ in 0..=numbers.below(3) {
        if numbers.chance(0.5) {
            let at = 4 * numbers.below(binary.len() / 4);
            let value = numbers.of(&FLOATS);
            binary[at..at + 4].copy_from_slice(&value.to_le_bytes());
        } else {
            let new = numbers.of(&NUMBERS);
            let new = serde_json::from_str(new).expect("these are numbers");
            let mut count = 0;
            each_number(&mut document, &mut |_| count += 1);
            let chosen = numbers.below(count);
            let mut index = 0;
            each_number(&mut document, &mut |number| {
                if index == chosen {
                    *number = Value::clone(&new);
                }
                index += 1;
            });
        }
    }
    pack(&document, &binary)
}

fn each_number(value: &mut Value, see: &mut impl FnMut(&mut Value)) {
    match value {
        Value::Number(_) => see(value),
        Value::Array(values) => values.iter_mut().for_each(|value| each_number(value, see)),
        Value::Object(fields) => fields.values_mut().for_each(|value| each_number(value, see)),
        _ => {}
    }
}
