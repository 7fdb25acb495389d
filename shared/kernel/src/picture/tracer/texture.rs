//! Images, looked up at a point.

use std::sync::LazyLock;

use crate::picture::{Encoding, Image, Texture, Wrap};
use glam::{DVec2, DVec3, DVec4};

/// Linear values of the bytes of sRGB (IEC 61966-2-1). By libm, so that they are the same on every machine.
static LINEAR: LazyLock<[f64; 256]> = LazyLock::new(|| {
    std::array::from_fn(|byte| {
        let value = byte as f64 / 255.0;
        if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) }
    })
});

/// Linear colour and alpha of an image at a place: 0 to 1 from left to right and from top to bottom, beyond them as the texture
/// says. Between the middles of four pixels they are mixed in proportion, as linear values.
pub(super) fn look_up(image: &Image, texture: &Texture, place: DVec2) -> DVec4 {
    let sizes = [image.width, image.height];
    let wrapped = |axis: usize, index: i64| wrap(index, sizes[axis], texture.wrap[axis]);
    let places: [f64; 2] =
        std::array::from_fn(|axis| period(place[axis], texture.wrap[axis]) * f64::from(sizes[axis]));
    if texture.nearest {
        let [x, y] = std::array::from_fn(|axis| wrapped(axis, places[axis].floor() as i64));
        return pixel(image, x, y);
    }
    let first = places.map(|place| (place - 0.5).floor());
    let [right, down]: [f64; 2] = std::array::from_fn(|axis| places[axis] - 0.5 - first[axis]);
    let [xs, ys]: [[u32; 2]; 2] =
        std::array::from_fn(|axis| [0, 1].map(|step| wrapped(axis, first[axis] as i64 + step)));
    let line = |y: u32| pixel(image, xs[0], y) * (1.0 - right) + pixel(image, xs[1], y) * right;
    line(ys[0]) * (1.0 - down) + line(ys[1]) * down
}

/// The same place, where numbers are small.
fn period(place: f64, wrap: Wrap) -> f64 {
    match wrap {
        Wrap::Repeat => place.rem_euclid(1.0),
        Wrap::Mirror => place.rem_euclid(2.0),
        Wrap::Clamp => place.clamp(0.0, 1.0),
    }
}

/// The pixel that stands where an image has none.
fn wrap(index: i64, size: u32, wrap: Wrap) -> u32 {
    let size = i64::from(size);
    let inside = match wrap {
        Wrap::Repeat => index.rem_euclid(size),
        Wrap::Clamp => index.clamp(0, size - 1),
        Wrap::Mirror => {
            let place = index.rem_euclid(2 * size);
            place.min(2 * size - 1 - place)
        }
    };
    inside as u32
}

fn pixel(image: &Image, x: u32, y: u32) -> DVec4 {
    let first = (y as usize * image.width as usize + x as usize) * 4;
    let byte = |channel: usize| image.pixels[first + channel];
    let part = |channel| f64::from(byte(channel)) / 255.0;
    match image.encoding {
        Encoding::Srgb => {
            let linear = |channel| LINEAR[usize::from(byte(channel))];
            DVec4::new(linear(0), linear(1), linear(2), part(3))
        }
        Encoding::Rgbm => (DVec3::new(part(0), part(1), part(2)) * part(3)).extend(1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Black, white; white, black: alpha counts the pixels.
    fn image() -> Image {
        let pixels = vec![0, 0, 0, 0, 255, 255, 255, 85, 255, 255, 255, 170, 0, 0, 0, 255];
        Image { width: 2, height: 2, encoding: Encoding::Srgb, pixels: pixels.into() }
    }

    fn at(wrap: Wrap, nearest: bool, u: f64, v: f64) -> DVec4 {
        look_up(&image(), &Texture { image: 0, wrap: [wrap; 2], nearest }, DVec2::new(u, v))
    }

    #[test]
    fn the_middle_of_a_pixel_is_that_pixel_and_the_middle_of_four_their_mean() {
        for nearest in [false, true] {
            assert_eq!(at(Wrap::Repeat, nearest, 0.75, 0.25), DVec4::new(1.0, 1.0, 1.0, 85.0 / 255.0));
            assert_eq!(at(Wrap::Repeat, nearest, 0.25, 0.75).w, 170.0 / 255.0);
        }
        assert!((at(Wrap::Repeat, false, 0.5, 0.5) - 0.5).abs().max_element() < 1e-15);
        assert_eq!(at(Wrap::Repeat, true, 0.5, 0.5), DVec4::new(0.0, 0.0, 0.0, 1.0));
    }

    #[test]
    fn beyond_its_borders_an_image_is_repeated_mirrored_or_prolonged() {
        for nearest in [false, true] {
            assert_eq!(at(Wrap::Repeat, nearest, 7.75, -2.75).w, 85.0 / 255.0);
            assert_eq!(at(Wrap::Mirror, nearest, 1.25, 0.25).w, 85.0 / 255.0);
            assert_eq!(at(Wrap::Mirror, nearest, -0.25, -0.25).w, 0.0);
            assert_eq!(at(Wrap::Clamp, nearest, 9.0, -9.0).w, 85.0 / 255.0);
        }
        // On the border a repeated image is mixed with its other side, a mirrored one with itself.
        assert_eq!(at(Wrap::Repeat, false, 0.0, 0.25).w, 0.5 * 85.0 / 255.0);
        assert_eq!(at(Wrap::Mirror, false, 0.0, 0.25).w, 0.0);
        // Places far away are places still.
        assert!(at(Wrap::Repeat, false, 3e38, -3e38).is_finite());
        assert!(at(Wrap::Mirror, false, 3e38, -3e38).is_finite());
    }

    #[test]
    fn bytes_are_srgb() {
        let pixels = vec![188, 10, 255, 128].into();
        let image = Image { width: 1, height: 1, encoding: Encoding::Srgb, pixels };
        let texture = Texture { image: 0, wrap: [Wrap::Repeat; 2], nearest: false };
        let texel = look_up(&image, &texture, DVec2::splat(0.3));
        let expected = DVec4::new(0.5028864580325687, 10.0 / 255.0 / 12.92, 1.0, 128.0 / 255.0);
        assert!((texel - expected).abs().max_element() < 1e-12, "{texel}");
    }

    #[test]
    fn multiplied_pixels_are_mixed_as_what_they_stand_for() {
        let pixels = vec![255, 51, 0, 255, 255, 255, 255, 51].into();
        let image = Image { width: 2, height: 1, encoding: Encoding::Rgbm, pixels };
        let texture = Texture { image: 0, wrap: [Wrap::Clamp; 2], nearest: false };
        for (place, expected) in [(0.25, [1.0, 0.2, 0.0]), (0.75, [0.2; 3]), (0.5, [0.6, 0.2, 0.1])] {
            let texel = look_up(&image, &texture, DVec2::new(place, 0.5));
            let expected = DVec3::from_array(expected).extend(1.0);
            assert!((texel - expected).abs().max_element() < 1e-12, "{place}: {texel}");
        }
    }
}
