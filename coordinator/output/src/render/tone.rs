use std::f64::consts::PI;

use document::texture::linear_to_srgb;
use glam::DVec3;

use super::Picture;

/// How radiance beyond what a screen shows is brought down to it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum ToneMap {
    /// Clamps at white, as viewers of a lit file do.
    #[default]
    Linear,
    /// Luminance by equation 4 of Reinhard, Stark, Shirley, Ferwerda, *Photographic Tone Reproduction for Digital Images* (2002):
    /// L (1 + L / W^2) / (1 + L), with W the largest luminance of the picture, or 1.
    Reinhard,
    /// Khronos PBR Neutral (Khronos Group, *PBR Neutral Tone Mapper*, 2024): colours as they are up to 0.8, then compressed
    /// towards white.
    Neutral,
}

impl ToneMap {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Reinhard => "reinhard",
            Self::Neutral => "neutral",
        }
    }

    /// Colours of a picture as a screen shows them, 0 to 1, linear, at this exposure.
    #[must_use]
    pub fn apply(self, picture: &Picture, exposure: f64) -> Vec<DVec3> {
        let shown = picture.pixels.iter().map(|pixel| display_colour(*pixel, exposure));
        let white = match self {
            Self::Reinhard => shown.clone().map(luminance).fold(1.0, f64::max),
            Self::Linear | Self::Neutral => 1.0,
        };
        let map = |colour| match self {
            Self::Linear => colour,
            Self::Reinhard => reinhard(colour, white),
            Self::Neutral => neutral(colour),
        };
        shown.map(|colour| map(colour).clamp(DVec3::ZERO, DVec3::ONE)).collect()
    }
}

/// Display colour of a radiance before tone mapping: pi x radiance x exposure, which is `COLOR_0` x base colour for a surface that
/// only reflects.
#[must_use]
pub fn display_colour(radiance: [f32; 3], exposure: f64) -> DVec3 {
    DVec3::from_array(radiance.map(f64::from)) * (PI * exposure)
}

/// Relative luminance of linear sRGB primaries (IEC 61966-2-1).
fn luminance(colour: DVec3) -> f64 {
    colour.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

fn reinhard(colour: DVec3, white: f64) -> DVec3 {
    let luminance = luminance(colour);
    colour * ((1.0 + luminance / (white * white)) / (1.0 + luminance))
}

/// Fresnel reflection at normal incidence that the mapper takes off again, where compression starts, and how fast colours fade.
const NEUTRAL: [f64; 3] = [0.04, 0.8, 0.15];

fn neutral(colour: DVec3) -> DVec3 {
    let [reflection, most, fading] = NEUTRAL;
    let least = colour.min_element();
    let offset =
        if least < 2.0 * reflection { least - least * least / (4.0 * reflection) } else { reflection };
    let colour = colour - offset;
    let (start, peak) = (most - reflection, colour.max_element());
    if peak <= start {
        return colour;
    }
    let room = 1.0 - start;
    let lowered = 1.0 - room * room / (peak + room - start);
    let faded = 1.0 / (fading * (peak - lowered) + 1.0);
    DVec3::splat(lowered).lerp(colour * (lowered / peak), faded)
}

/// The byte of sRGB for a linear value between 0 and 1.
#[must_use]
pub(crate) fn srgb_byte(linear: f64) -> u8 {
    (linear_to_srgb(linear) * 255.0).round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use document::texture::srgb_to_linear;

    fn picture(pixels: Vec<[f32; 3]>) -> Picture {
        Picture { size: [pixels.len() as u32, 1], pixels, rays: 0, busy_nanoseconds: 0 }
    }

    fn grey(value: f64) -> [f32; 3] {
        [(value / PI) as f32; 3]
    }

    #[test]
    fn linear_clips_and_scales() {
        let mapped = ToneMap::Linear.apply(&picture(vec![grey(0.25), grey(0.75), grey(9.0)]), 2.0);
        for (found, expected) in mapped.iter().zip([0.5, 1.0, 1.0]) {
            assert!((found.x - expected).abs() < 1e-6, "{found}");
        }
    }

    #[test]
    fn reinhard_sends_the_brightest_to_white_and_keeps_hues() {
        let mapped = ToneMap::Reinhard.apply(&picture(vec![grey(1.0), grey(4.0)]), 1.0);
        assert!((mapped[0].x - (1.0 + 1.0 / 16.0) / 2.0).abs() < 1e-6);
        assert!((mapped[1].x - 1.0).abs() < 1e-6);
        let coloured = reinhard(DVec3::new(0.2, 0.4, 0.8), 4.0);
        assert!((coloured.z / coloured.x - 4.0).abs() < 1e-12);
    }

    #[test]
    fn neutral_keeps_colours_and_compresses_highlights() {
        // Below the start only the reflection of 0.04 is taken off.
        assert!((neutral(DVec3::splat(0.5)) - 0.46).abs().max_element() < 1e-12);
        assert_eq!(neutral(DVec3::ZERO), DVec3::ZERO);
        let values: Vec<f64> =
            [0.8, 1.0, 2.0, 10.0, 1e4].map(|value| neutral(DVec3::splat(value)).x).to_vec();
        assert!((values[0] - 0.76).abs() < 1e-12);
        assert!(values.is_sorted() && *values.last().unwrap() < 1.0 && values[4] > 0.999, "{values:?}");
        // A bright colour fades towards white.
        let red = neutral(DVec3::new(20.0, 0.0, 0.0));
        assert!(red.x < 1.0 && red.y > 0.5 && red.x > red.y, "{red}");
    }

    #[test]
    fn bytes_are_the_inverse_of_decoding() {
        for byte in 0..=255_u8 {
            assert_eq!(srgb_byte(srgb_to_linear(f64::from(byte) / 255.0)), byte);
        }
        assert_eq!((srgb_byte(0.0), srgb_byte(1.0), srgb_byte(0.5)), (0, 255, 188));
    }
}
