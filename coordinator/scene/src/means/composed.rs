//! Images of one mapping as one: the product of what they say is made texel by texel, and averaged as a product.

use std::sync::Arc;

use glam::{DVec3, DVec4};

use super::Raster;
use document::texture::{Encoding, Image};

/// Meaning of alpha.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Opacity {
    /// Nothing: all of the surface is there.
    Opaque,
    /// Texels below the cutoff are holes, the others opaque.
    Mask {
        /// Multiplies alpha.
        factor: f64,
        /// Least alpha of what is there.
        cutoff: f64,
    },
    /// The part of the light that the surface takes; the other part passes.
    Blend {
        /// Multiplies alpha.
        factor: f64,
    },
}

impl Opacity {
    /// The opacity of this alpha, in [0, 1].
    #[must_use]
    pub fn of(self, alpha: f64) -> f64 {
        match self {
            Self::Opaque => 1.0,
            Self::Mask { factor, cutoff } => f64::from(u8::from(alpha * factor >= cutoff)),
            Self::Blend { factor } => (alpha * factor).clamp(0.0, 1.0),
        }
    }
}

/// A texture that reduces diffuse reflection.
#[derive(Debug, Clone)]
pub enum Dimming {
    /// The blue channel of a metallic-roughness texture, times a factor, is the metal's part.
    Metal(Arc<Image>, f64),
    /// The largest channel of a specular colour, times a factor each, is the mirrored part.
    Specular(Arc<Image>, DVec3),
    /// The red channel of a transmission texture, times a factor, is the part that passes through.
    Transmission(Arc<Image>, f64),
}

impl Dimming {
    fn image(&self) -> &Arc<Image> {
        match self {
            Self::Metal(image, _) | Self::Specular(image, _) | Self::Transmission(image, _) => image,
        }
    }

    /// The part of the light left to diffuse reflection.
    fn rest(&self, [red, green, blue, _]: [u8; 4]) -> f64 {
        match self {
            Self::Metal(_, factor) => 1.0 - factor * Encoding::Linear.decode(blue),
            Self::Transmission(_, factor) => 1.0 - factor * Encoding::Linear.decode(red),
            Self::Specular(_, factor) => {
                let colour =
                    DVec3::from_array([red, green, blue].map(|stored| Encoding::Srgb.decode(stored)));
                (1.0 - (colour * *factor).max_element()).max(0.0)
            }
        }
    }

    fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Metal(image, factor), Self::Metal(other, same))
            | (Self::Transmission(image, factor), Self::Transmission(other, same)) => {
                Arc::ptr_eq(image, other) && factor == same
            }
            (Self::Specular(image, factor), Self::Specular(other, same)) => {
                Arc::ptr_eq(image, other) && factor == same
            }
            _ => false,
        }
    }
}

/// The product of images: colour x what dimming leaves x opacity, and the opacity itself as the fourth value. As large as the largest
/// of them; the texels of smaller ones are repeated, which changes no mean where their size divides it.
#[derive(Debug, Clone)]
pub struct Composed {
    colour: Option<Arc<Image>>,
    dimming: Vec<Dimming>,
    alpha: Option<(Arc<Image>, Opacity)>,
    /// That of the largest image: found once, since each texel asks for it.
    size: [u32; 2],
}

impl Composed {
    /// Composes images of one mapping: a colour in sRGB, white where there is none; what reduces it; and the alpha of the surface with
    /// its meaning, opaque where there is none.
    #[must_use]
    pub fn new(
        colour: Option<Arc<Image>>,
        dimming: Vec<Dimming>,
        alpha: Option<(Arc<Image>, Opacity)>,
    ) -> Self {
        let mut composed = Self { colour, dimming, alpha, size: [1, 1] };
        let larger = |[width, height]: [u32; 2], image: &Arc<Image>| {
            [width.max(image.width()), height.max(image.height())]
        };
        composed.size = composed.images().fold(composed.size, larger);
        composed
    }

    /// The same images with one more that reduces the colour.
    #[must_use]
    pub fn dimmed(&self, dimming: Dimming) -> Self {
        let mut all = self.dimming.clone();
        all.push(dimming);
        Self::new(self.colour.clone(), all, self.alpha.clone())
    }

    /// Whether an image has the surface's alpha.
    #[must_use]
    pub fn has_alpha(&self) -> bool {
        self.alpha.is_some()
    }

    /// Whether both have the same images and factors.
    #[must_use]
    pub fn is(&self, other: &Self) -> bool {
        let colour = |of: &Self| of.colour.as_ref().map(Arc::as_ptr);
        let alpha = |of: &Self| of.alpha.as_ref().map(|(image, opacity)| (Arc::as_ptr(image), *opacity));
        let same_dimming = self.dimming.len() == other.dimming.len()
            && self.dimming.iter().zip(&other.dimming).all(|(a, b)| a.is(b));
        colour(self) == colour(other) && alpha(self) == alpha(other) && same_dimming
    }

    fn images(&self) -> impl Iterator<Item = &Arc<Image>> {
        self.colour
            .iter()
            .chain(self.dimming.iter().map(Dimming::image))
            .chain(self.alpha.iter().map(|(image, _)| image))
    }
}

impl Raster for Composed {
    /// Each texel is several images' decoded anew; those of a coarser image are ready.
    const MOST_PASSED: f64 = 256.0;

    fn size(&self) -> [u32; 2] {
        self.size
    }

    fn texel(&self, column: u32, row: u32) -> DVec4 {
        let [width, height] = self.size;
        let scaled = |place: u32, own: u32, all: u32| {
            if own == all { place } else { (u64::from(place) * u64::from(own) / u64::from(all)) as u32 }
        };
        let stored = |image: &Image| {
            image.texel(scaled(column, image.width(), width), scaled(row, image.height(), height))
        };
        let colour = self.colour.as_deref().map_or(DVec3::ONE, |image| {
            let [red, green, blue, _] = stored(image);
            DVec3::from_array([red, green, blue].map(|stored| Encoding::Srgb.decode(stored)))
        });
        let rest: f64 = self.dimming.iter().map(|dimming| dimming.rest(stored(dimming.image()))).product();
        let opacity = self
            .alpha
            .as_ref()
            .map_or(1.0, |(image, opacity)| opacity.of(Encoding::Linear.decode(stored(image)[3])));
        (colour * (rest * opacity)).extend(opacity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, texels: &[[u8; 4]]) -> Arc<Image> {
        Arc::new(Image::new(width, texels.len() as u32 / width, texels.to_vec()).unwrap())
    }

    #[test]
    fn products_are_made_before_means() {
        // White where it is metal, black where it is not: nothing is left of either.
        let colour = image(2, &[[255, 255, 255, 255], [0, 0, 0, 255]]);
        let metal = image(2, &[[0, 0, 255, 255], [0, 0, 0, 255]]);
        let dimming = vec![Dimming::Metal(metal, 1.0)];
        let composed = Composed::new(Some(colour), dimming, None);
        assert_eq!([0, 1].map(|column| composed.texel(column, 0)), [DVec4::W, DVec4::W]);
    }

    #[test]
    fn smaller_images_are_stretched() {
        let colour = image(1, &[[255, 0, 0, 255]]);
        let metal = image(4, &[[0, 0, 0, 0], [0, 0, 51, 0], [0, 0, 102, 0], [0, 0, 255, 0]]);
        let dimming = vec![Dimming::Metal(metal, 1.0)];
        let composed = Composed::new(Some(colour), dimming, None);
        assert_eq!(composed.size(), [4, 1]);
        let reds = [0, 1, 2, 3].map(|column| composed.texel(column, 0).x);
        assert!((DVec4::from_array(reds) - DVec4::new(1.0, 0.8, 0.6, 0.0)).abs().max_element() < 1e-15);
    }

    #[test]
    fn masks_decide_each_texel_and_blending_weighs_it() {
        let colour = image(3, &[[255, 255, 255, 51], [255, 255, 255, 128], [255, 255, 255, 255]]);
        let opacities = |opacity| {
            let composed = Composed::new(Some(colour.clone()), vec![], Some((colour.clone(), opacity)));
            let texels = [0, 1, 2].map(|column| composed.texel(column, 0));
            assert!(texels.iter().all(|texel| texel.x == texel.w));
            texels.map(|texel| texel.w)
        };
        assert_eq!(opacities(Opacity::Opaque), [1.0; 3]);
        assert_eq!(opacities(Opacity::Mask { factor: 1.0, cutoff: 0.5 }), [0.0, 1.0, 1.0]);
        assert_eq!(opacities(Opacity::Mask { factor: 0.9, cutoff: 0.5 }), [0.0, 0.0, 1.0]);
        assert_eq!(opacities(Opacity::Blend { factor: 0.5 }), [0.1, 64.0 / 255.0, 0.5]);
    }

    #[test]
    fn specular_colour_takes_its_largest_channel() {
        let specular = image(1, &[[255, 0, 0, 255]]);
        let dimming = vec![Dimming::Specular(specular, DVec3::new(0.25, 1.0, 1.0))];
        let composed = Composed::new(None, dimming, None);
        assert_eq!(composed.texel(0, 0), DVec4::new(0.75, 0.75, 0.75, 1.0));
    }
}
