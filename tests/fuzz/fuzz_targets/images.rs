//! Whatever the bytes, decoding gives an error, or as many texels as the size says.
#![no_main]

use document::texture::{MOST_BYTES, decode};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(image) = decode(bytes) else { return };
    let texels = u64::from(image.width()) * u64::from(image.height());
    assert!(texels > 0 && 4 * texels <= MOST_BYTES);
    assert_eq!(image.texels().len() as u64, texels);
});
