//! Procedural images, as PNG.

use std::io::Cursor;

use image::{ImageFormat, RgbImage, RgbaImage};

/// A well-mixed number in [0, 1) of two: the finaliser of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
pub fn chance(seed: u64, number: u64) -> f64 {
    let mut z =
        seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(number.wrapping_mul(0xd1b5_4a32_d192_ed03));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Smooth noise in [0, 1) with this period in cells along both sides.
fn noise(seed: u64, x: f64, y: f64, period: [u64; 2]) -> f64 {
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (column, row) = (x.floor(), y.floor());
    let at = |dx: u64, dy: u64| {
        let cell = |place: f64, d: u64, period: u64| (place.rem_euclid(period as f64) as u64 + d) % period;
        chance(seed, cell(column, dx, period[0]) + 4096 * cell(row, dy, period[1]))
    };
    let (s, t) = (smooth(x - column), smooth(y - row));
    let upper = at(0, 0) + (at(1, 0) - at(0, 0)) * s;
    let lower = at(0, 1) + (at(1, 1) - at(0, 1)) * s;
    upper + (lower - upper) * t
}

/// Between two sRGB colours.
fn mixed(a: [f64; 3], b: [f64; 3], part: f64) -> [f64; 3] {
    std::array::from_fn(|channel| a[channel] + (b[channel] - a[channel]) * part.clamp(0.0, 1.0))
}

fn picture(width: u32, height: u32, colour: impl Fn(f64, f64) -> [f64; 3]) -> Vec<u8> {
    let image = RgbImage::from_fn(width, height, |x, y| {
        let [u, v] = [(f64::from(x) + 0.5) / f64::from(width), (f64::from(y) + 0.5) / f64::from(height)];
        // Few levels: a small file.
        image::Rgb(colour(u, v).map(|value| ((value.clamp(0.0, 1.0) * 63.0).round() * 255.0 / 63.0) as u8))
    });
    let mut bytes = Cursor::new(vec![]);
    image.write_to(&mut bytes, ImageFormat::Png).expect("a PNG can be written to memory");
    bytes.into_inner()
}

/// Planks along u: seven across v.
pub fn planks() -> Vec<u8> {
    picture(256, 256, |u, v| {
        let plank = (v * 7.0).floor() as u64;
        let shift = chance(1, plank);
        let end = ((u + shift).rem_euclid(1.0) * 2.0).floor() as u64;
        let tone = chance(2, 2 * plank + end);
        let grain = noise(3 + plank, u * 6.0, v * 160.0, [6, 160]);
        let wood = mixed([0.62, 0.42, 0.25], [0.76, 0.57, 0.36], 0.6 * tone + 0.4 * grain);
        let gap = (v * 7.0).fract().min(1.0 - (v * 7.0).fract()) < 0.03
            || ((u + shift) * 2.0).fract().min(1.0 - ((u + shift) * 2.0).fract()) < 0.008;
        if gap { mixed(wood, [0.25, 0.16, 0.1], 0.7) } else { wood }
    })
}

/// Stripes and small blossoms.
pub fn wallpaper() -> Vec<u8> {
    picture(128, 128, |u, v| {
        let stripe = if (u * 4.0).fract() < 0.5 { [0.87, 0.85, 0.78] } else { [0.82, 0.82, 0.76] };
        let row = (v * 4.0).floor();
        let (x, y) = ((u * 4.0 + 0.5 * row).fract() - 0.5, (v * 4.0).fract() - 0.5);
        let (radius, angle) = (x.hypot(y), libm::atan2(y, x));
        if radius < 0.04 {
            [0.85, 0.66, 0.3]
        } else if radius < 0.11 + 0.05 * libm::cos(5.0 * angle) {
            [0.62, 0.42, 0.45]
        } else {
            stripe
        }
    })
}

/// A rug: a border around medallions; for texture coordinates from 0 to 1.
pub fn rug() -> Vec<u8> {
    picture(128, 96, |u, v| {
        let edge = (u.min(1.0 - u) * 4.0 / 3.0).min(v.min(1.0 - v));
        let weave = 0.06 * noise(9, u * 128.0, v * 96.0, [128, 96]);
        let colour = match edge {
            _ if edge < 0.03 => [0.75, 0.68, 0.55],
            _ if edge < 0.1 => [0.42, 0.12, 0.12],
            _ if edge < 0.13 => [0.75, 0.68, 0.55],
            _ => {
                let (x, y) = ((u * 6.0).fract() - 0.5, (v * 4.0).fract() - 0.5);
                if x.abs() + y.abs() < 0.3 { [0.2, 0.25, 0.42] } else { [0.55, 0.2, 0.17] }
            }
        };
        colour.map(|value| value - weave)
    })
}

/// Woven cloth of one colour.
pub fn cloth() -> Vec<u8> {
    picture(64, 64, |u, v| {
        let thread = libm::sin(u * 100.53) * libm::sin(v * 100.53);
        mixed(
            [0.36, 0.47, 0.5],
            [0.5, 0.6, 0.62],
            0.5 + 0.3 * thread + 0.2 * noise(5, u * 8.0, v * 8.0, [8, 8]),
        )
    })
}

/// A painting: hills under an evening sky.
pub fn painting() -> Vec<u8> {
    picture(128, 96, |u, v| {
        let hill =
            |height: f64, seed: u64, steep: f64| v > height - steep * noise(seed, u * 5.0, 0.5, [64, 1]);
        if hill(0.98, 13, 0.25) {
            [0.16, 0.25, 0.14]
        } else if hill(0.8, 12, 0.25) {
            [0.25, 0.36, 0.26]
        } else if hill(0.68, 11, 0.2) {
            [0.4, 0.45, 0.5]
        } else if (u - 0.68).hypot(0.75 * (v - 0.36)) < 0.07 {
            [0.98, 0.9, 0.62]
        } else {
            mixed([0.35, 0.45, 0.65], [0.95, 0.66, 0.42], v * 1.5)
        }
    })
}

/// Lace: holes where alpha is 0.
pub fn lace() -> Vec<u8> {
    let size = 64;
    let image = RgbaImage::from_fn(size, size, |x, y| {
        let [u, v] = [x, y].map(|place| (f64::from(place) + 0.5) / f64::from(size));
        let (a, b) = ((u * 4.0).fract() - 0.5, (v * 4.0).fract() - 0.5);
        let is_hole = a.hypot(b) < 0.3;
        image::Rgba([226, 222, 208, if is_hole { 0 } else { 255 }])
    });
    let mut bytes = Cursor::new(vec![]);
    image.write_to(&mut bytes, ImageFormat::Png).expect("a PNG can be written to memory");
    bytes.into_inner()
}

/// Bricks in mortar, two courses a tile of 50 by 25 centimetres.
pub fn bricks() -> Vec<u8> {
    picture(128, 128, |u, v| {
        let course = (v * 8.0).floor();
        let along = u * 4.0 + 0.5 * (course % 2.0);
        let (x, y) = (along.fract(), (v * 8.0).fract());
        if x < 0.05 || y < 0.1 {
            [0.72, 0.7, 0.66]
        } else {
            let tone = chance(21, (along.floor() as u64 % 4) + 8 * course as u64);
            mixed([0.55, 0.25, 0.19], [0.7, 0.38, 0.28], tone)
        }
    })
}

/// Grass.
pub fn grass() -> Vec<u8> {
    picture(64, 64, |u, v| {
        let tone =
            0.6 * noise(31, u * 16.0, v * 16.0, [16, 16]) + 0.4 * noise(32, u * 48.0, v * 48.0, [48, 48]);
        mixed([0.22, 0.34, 0.13], [0.42, 0.5, 0.22], tone)
    })
}

/// A board of squares in two colours.
pub fn squares(one: [f64; 3], other: [f64; 3]) -> Vec<u8> {
    picture(64, 64, |u, v| if ((u * 8.0) as u32 + (v * 8.0) as u32).is_multiple_of(2) { one } else { other })
}

/// A spectrum over u, paler with v.
pub fn spectrum() -> Vec<u8> {
    picture(96, 32, |u, v| {
        let channel = |shift: f64| 0.5 + 0.42 * libm::cos(std::f64::consts::TAU * (u + shift));
        mixed([channel(0.0), channel(-1.0 / 3.0), channel(1.0 / 3.0)], [0.85, 0.85, 0.85], 0.6 * v)
    })
}
