//! What is seen of a surface.

use std::f64::consts::FRAC_1_PI;

use crate::picture::{Alpha, Part, Texture};
use glam::{DVec2, DVec3, DVec4};

use super::Picture;
use super::texture::look_up;
use super::tree::Hit;

/// What is seen of a surface at a point.
pub(super) struct Seen {
    /// Radiance where it is.
    pub(super) radiance: DVec3,
    /// How much of what is behind it hides.
    pub(super) opacity: f64,
}

impl Picture {
    /// True where the alpha of a cut-out surface is below its cutoff.
    pub(super) fn is_hole(&self, hit: &Hit) -> bool {
        let part = &self.parts[hit.part as usize];
        match part.alpha {
            Alpha::Mask(cutoff) => self.base(part, hit).w < f64::from(cutoff),
            Alpha::Opaque | Alpha::Blend => false,
        }
    }

    /// Radiance: reflectance x irradiance / pi + emission.
    pub(super) fn surface(&self, hit: &Hit) -> Seen {
        let part = &self.parts[hit.part as usize];
        let base = self.base(part, hit);
        let mut irradiance = DVec3::from_array(self.interpolated(part, hit, &part.irradiance, 0.0));
        if let Some(texture) = &part.irradiance_texture {
            irradiance *= self.texel(part, hit, texture, &part.irradiance_coordinates).truncate();
        }
        let mut emission = DVec3::from_array(part.emission.map(f64::from));
        if let Some(texture) = &part.emission_texture {
            emission *= self.texel(part, hit, texture, &part.emission_coordinates).truncate();
        }
        let opacity = if part.alpha == Alpha::Blend { base.w.min(1.0) } else { 1.0 };
        Seen { radiance: base.truncate() * irradiance * FRAC_1_PI + emission, opacity }
    }

    /// Reflectance and alpha: factor x vertex colour x texture.
    fn base(&self, part: &Part, hit: &Hit) -> DVec4 {
        let mut base = DVec4::from_array(part.base.map(f64::from));
        base *= DVec4::from_array(self.interpolated(part, hit, &part.colours, 1.0));
        if let Some(texture) = &part.base_texture {
            base *= self.texel(part, hit, texture, &part.base_coordinates);
        }
        base
    }

    fn texel(&self, part: &Part, hit: &Hit, texture: &Texture, coordinates: &[[f32; 2]]) -> DVec4 {
        let place = DVec2::from_array(self.interpolated(part, hit, coordinates, 0.0));
        look_up(&self.images[texture.image as usize], texture, place)
    }

    /// A value per vertex at the point, or `default` where there are none.
    fn interpolated<const N: usize>(
        &self,
        part: &Part,
        hit: &Hit,
        values: &[[f32; N]],
        default: f64,
    ) -> [f64; N] {
        if values.is_empty() {
            return [default; N];
        }
        let [a, b, c] = part.triangles[hit.triangle as usize].map(|vertex| values[vertex as usize]);
        let weights = hit.weights;
        std::array::from_fn(|place| {
            weights.x * f64::from(a[place])
                + weights.y * f64::from(b[place])
                + weights.z * f64::from(c[place])
        })
    }
}
