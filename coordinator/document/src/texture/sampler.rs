//! What lies outside of an image, and between its texels.

use glam::{DVec2, DVec4};
use gltf::texture::{MagFilter, WrappingMode};

use super::{Encoding, Image};

/// What an image is continued with beyond its edges.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Wrap {
    /// With itself.
    #[default]
    Repeat,
    /// With itself mirrored, in turns.
    Mirror,
    /// With its last texels.
    Clamp,
}

impl Wrap {
    /// The texel that stands in a place of the continued image, along a side of so many texels.
    #[must_use]
    pub fn texel(self, place: i64, count: u32) -> u32 {
        let count = i64::from(count);
        let texel = match self {
            Self::Repeat => place.rem_euclid(count),
            Self::Mirror => {
                let turned = place.rem_euclid(2 * count);
                turned.min(2 * count - 1 - turned)
            }
            Self::Clamp => place.clamp(0, count - 1),
        };
        texel as u32
    }
}

/// What lies between the centres of texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Filter {
    /// Each texel is a square of one colour.
    Nearest,
    /// The four centres around a point are interpolated, their linear values.
    #[default]
    Linear,
}

/// How an image is continued and interpolated.
///
/// Of a glTF sampler's filters the magnifying one counts, linear where it is not said; minifying ones are a means of computing what
/// the mean over an area is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Sampler {
    /// Along u.
    pub wrap_u: Wrap,
    /// Along v.
    pub wrap_v: Wrap,
    /// Between texels.
    pub filter: Filter,
}

impl Sampler {
    /// A sampler of a glTF.
    #[must_use]
    pub fn new(sampler: &gltf::texture::Sampler) -> Self {
        let wrap = |mode| match mode {
            WrappingMode::ClampToEdge => Wrap::Clamp,
            WrappingMode::MirroredRepeat => Wrap::Mirror,
            WrappingMode::Repeat => Wrap::Repeat,
        };
        let filter = match sampler.mag_filter() {
            Some(MagFilter::Nearest) => Filter::Nearest,
            Some(MagFilter::Linear) | None => Filter::Linear,
        };
        Self { wrap_u: wrap(sampler.wrap_s()), wrap_v: wrap(sampler.wrap_t()), filter }
    }

    /// The linear value of an image at texture coordinates: red, green, blue, alpha.
    #[must_use]
    pub fn look_up(&self, image: &Image, encoding: Encoding, uv: DVec2) -> DVec4 {
        self.interpolate([image.width(), image.height()], uv, |column, row| {
            let [red, green, blue, alpha] = image.texel(column, row);
            let [red, green, blue] = [red, green, blue].map(|stored| encoding.decode(stored));
            DVec4::new(red, green, blue, f64::from(alpha) / 255.0)
        })
    }

    /// The value at texture coordinates of an image of this width and height, whose texels (column, row) have these values. Coordinates
    /// that are not finite count as 0.
    pub fn interpolate(&self, size: [u32; 2], uv: DVec2, texel: impl Fn(u32, u32) -> DVec4) -> DVec4 {
        let [width, height] = size;
        let uv = if uv.is_finite() { uv } else { DVec2::ZERO };
        // Beyond this no fraction of a texel is left, and no place fits into an integer.
        let place = (uv * DVec2::new(f64::from(width), f64::from(height)))
            .clamp(DVec2::splat(-FARTHEST), DVec2::splat(FARTHEST));
        let at = |column: f64, row: f64| {
            texel(self.wrap_u.texel(column as i64, width), self.wrap_v.texel(row as i64, height))
        };
        match self.filter {
            Filter::Nearest => at(place.x.floor(), place.y.floor()),
            Filter::Linear => {
                let place = place - 0.5;
                let (low, part) = (place.floor(), place - place.floor());
                let upper = at(low.x, low.y).lerp(at(low.x + 1.0, low.y), part.x);
                let lower = at(low.x, low.y + 1.0).lerp(at(low.x + 1.0, low.y + 1.0), part.x);
                upper.lerp(lower, part.y)
            }
        }
    }
}

/// Farthest place, in texels.
const FARTHEST: f64 = (1_u64 << 50) as f64;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_outside_are_continued() {
        let row = |wrap: Wrap| (-4..7).map(|place| wrap.texel(place, 3)).collect::<Vec<_>>();
        assert_eq!(row(Wrap::Repeat), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0]);
        assert_eq!(row(Wrap::Mirror), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0]);
        assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2]);
    }

    /// Black, white; alpha 0 and 1.
    fn pair() -> Image {
        Image::new(2, 1, vec![[0, 0, 0, 0], [255, 255, 255, 255]]).unwrap()
    }

    fn values(sampler: Sampler, places: &[f64]) -> Vec<f64> {
        let value = |u: &f64| sampler.look_up(&pair(), Encoding::Srgb, DVec2::new(*u, 0.3)).x;
        places.iter().map(value).collect()
    }

    #[test]
    fn linear_values_are_interpolated_between_centres() {
        let sampler = Sampler::default();
        assert_eq!(values(sampler, &[0.25, 0.5, 0.625, 0.75, 1.0]), [0.0, 0.5, 0.75, 1.0, 0.5]);
        let clamped = Sampler { wrap_u: Wrap::Clamp, ..sampler };
        assert_eq!(values(clamped, &[-3.0, 0.0, 0.5, 1.0, 9.0]), [0.0, 0.0, 0.5, 1.0, 1.0]);
        let mirrored = Sampler { wrap_u: Wrap::Mirror, ..sampler };
        assert_eq!(values(mirrored, &[0.0, 1.0, 1.25, 1.5, 1.75]), [0.0, 1.0, 1.0, 0.5, 0.0]);
    }

    #[test]
    fn nearest_texels_have_edges() {
        let sampler = Sampler { filter: Filter::Nearest, ..Sampler::default() };
        assert_eq!(values(sampler, &[0.0, 0.49, 0.5, 0.99, 1.0, -0.01]), [0.0, 0.0, 1.0, 1.0, 0.0, 1.0]);
    }

    #[test]
    fn wild_coordinates_give_a_value() {
        for wild in [f64::NAN, f64::INFINITY, 1e300, -1e300, 1e18] {
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                let sampler = Sampler { wrap_u: wrap, wrap_v: wrap, ..Sampler::default() };
                let value = sampler.look_up(&pair(), Encoding::Linear, DVec2::new(wild, -wild));
                assert!(value.min_element() >= 0.0 && value.max_element() <= 1.0, "{wild}: {value}");
            }
        }
    }
}
