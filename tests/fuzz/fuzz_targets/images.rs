//! Whatever the bytes, decoding gives an error, or as many texels as the size says; those of a sky are radiance.
#![no_main]

use document::sky::{Projection, SkyImage};
use document::texture::{MOST_BYTES, decode};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(sky) = SkyImage::from_bytes(bytes) {
        let Projection::Equirectangular { width, height } = sky.projection else {
            unreachable!("it is no cube")
        };
        assert_eq!(sky.texels.len(), width * height);
        assert!(sky.texels.iter().flatten().all(|value| value.is_finite() && *value >= 0.0));
    }
    let Ok(image) = decode(bytes) else { return };
    let texels = u64::from(image.width()) * u64::from(image.height());
    assert!(texels > 0 && 4 * texels <= MOST_BYTES);
    assert_eq!(image.texels().len() as u64, texels);
});
