//! Textures and vertex colours of a surface, and their means over its polygons.
//!
//! A [`Pattern`] is what a material's textures say; an [`Appearance`] joins it with the texture coordinates and colours of a
//! primitive's vertices. Both are affine over a facet, so that a polygon of it is a polygon on the image.
//!
//! Images of one mapping are multiplied texel by texel and averaged as a product. Between what does not share a mapping, and with vertex
//! colours, the product of the means is taken: the patterns of two unrelated images, or of an image and a slow change from vertex to
//! vertex, have nothing to do with each other.

use std::sync::Arc;

use glam::{DVec2, DVec3, DVec4};
use kernel::geometry::area_vector;

use crate::facet::{Facet, SourceTriangle};
use crate::means::{AreaMeans, Composed, Opacity};
use document::LEAST_OF_GLASS;
use document::texture::Mapping;

/// Largest reflectance. At 1 light would never be absorbed and nothing would converge in a closed scene.
pub(crate) const MAX_REFLECTANCE: f64 = 0.999;

/// Triangles along each side of a polygon without area on the image, which is sampled at their centres.
const SAMPLES_ALONG_SIDE: usize = 4;

/// Places on an image closer than this, in widths of the image, are one.
const ONE_PLACE: f64 = 1e-9;

/// An image and how it lies on surfaces.
#[derive(Clone)]
pub struct Layer {
    /// The image, ready for means.
    pub image: Arc<AreaMeans<Composed>>,
    /// How it lies.
    pub mapping: Mapping,
}

/// The textures and factors of a material.
#[derive(Clone)]
pub struct Pattern {
    /// Reflected part without its factor, with the opacity in it and as fourth value.
    pub reflecting: Option<Layer>,
    /// A texture that reduces the reflection and is mapped differently from the layer above.
    pub dimming: Option<Layer>,
    /// What a transmission texture leaves to diffuse reflection.
    pub transmitting: Option<Layer>,
    /// True where that has all of `reflecting` in it already, texel by texel.
    pub transmitting_has_colour: bool,
    /// Emission without its factor.
    pub emitting: Option<Layer>,
    /// True where the emission has the opacity in it already.
    pub emitting_has_opacity: bool,
    /// Factor of the reflected part.
    pub reflectance: DVec3,
    /// Factor of the emission: exitance.
    pub exitance: DVec3,
    /// Meaning of alpha.
    pub opacity: Opacity,
    /// Part of the light that passes through instead of being reflected diffusely, in [0, 1], where no texture says it.
    pub transmission: f64,
}

impl Pattern {
    /// Whether light passes through what is there.
    fn transmits(&self) -> bool {
        self.transmission != 0.0 || self.transmitting.is_some()
    }

    /// Reflectance and opacity, given what would be reflected if nothing were transmitted, with the opacity `alpha` in it, and the
    /// part `left` of it. The rest passes; as one opacity counts for all channels, it is their mean.
    pub(crate) fn with_transmission(&self, diffuse: DVec3, left: DVec3, alpha: f64) -> (DVec3, f64) {
        // Colours above 1 would make light.
        let diffuse = diffuse.min(DVec3::splat(alpha));
        let passing = (diffuse * (DVec3::ONE - left)).element_sum() / 3.0;
        let least = if self.exitance == DVec3::ZERO { 0.0 } else { LEAST_OF_GLASS.min(alpha) };
        let reflectance = (diffuse * left).min(DVec3::splat(MAX_REFLECTANCE));
        (reflectance, (alpha - passing).max(least))
    }
}

/// Values of a primitive's vertices, as far as the pattern needs them.
#[derive(Debug, Clone, Default)]
pub struct VertexValues {
    /// TEXCOORD_n by n.
    pub coordinates: Vec<(u32, Vec<[f32; 2]>)>,
    /// COLOR_0, linear.
    pub colours: Option<Vec<[f32; 4]>>,
}

impl VertexValues {
    fn set(&self, set: u32) -> Option<&[[f32; 2]]> {
        self.coordinates.iter().find(|(own, _)| *own == set).map(|(_, values)| values.as_slice())
    }
}

/// A pattern with the vertex values of a surface.
pub struct Appearance {
    pattern: Arc<Pattern>,
    vertices: Arc<VertexValues>,
    /// The largest triangle of each facet: it tells best how values change over the facet.
    largest: Vec<u32>,
}

impl std::fmt::Debug for Appearance {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(formatter, "Appearance({} facets)", self.largest.len())
    }
}

impl Appearance {
    /// The appearance of these facets. Values of vertices that are not there count as 0.
    #[must_use]
    pub fn new(pattern: Arc<Pattern>, vertices: VertexValues, facets: &[Facet]) -> Self {
        Self { largest: largest_triangles(facets), pattern, vertices: Arc::new(vertices) }
    }

    /// The same for other facets, pieces of its own.
    pub(crate) fn of_pieces(&self, facets: &[Facet]) -> Self {
        Self {
            largest: largest_triangles(facets),
            pattern: self.pattern.clone(),
            vertices: self.vertices.clone(),
        }
    }

    /// Mean reflectance over a polygon of a facet.
    #[must_use]
    pub fn reflectance(&self, index: u32, facet: &Facet, polygon: &[DVec3]) -> DVec3 {
        let Some(place) = self.place(index, facet, polygon) else { return DVec3::ZERO };
        self.reflectance_and_opacity(&place, &self.colour_and_opacity(&place)).0
    }

    /// Mean exitance over a polygon of a facet.
    #[must_use]
    pub fn exitance(&self, index: u32, facet: &Facet, polygon: &[DVec3]) -> DVec3 {
        if self.pattern.exitance == DVec3::ZERO {
            return DVec3::ZERO;
        }
        let Some(place) = self.place(index, facet, polygon) else { return DVec3::ZERO };
        self.exitance_at(&place, || self.colour_and_opacity(&place).1)
    }

    /// Mean opacity over a polygon of a facet.
    #[must_use]
    pub fn opacity(&self, index: u32, facet: &Facet, polygon: &[DVec3]) -> f64 {
        let transmits = self.pattern.transmits();
        if self.pattern.opacity == Opacity::Opaque && !transmits {
            return 1.0;
        }
        let Some(place) = self.place(index, facet, polygon) else { return 1.0 };
        let known = self.colour_and_opacity(&place);
        // Without transmission colours do not count.
        if transmits { self.reflectance_and_opacity(&place, &known).1 } else { known.1.all() }
    }

    /// All three of them, for little more than one: reflectance, exitance and opacity.
    #[must_use]
    pub fn material(&self, index: u32, facet: &Facet, polygon: &[DVec3]) -> (DVec3, DVec3, f64) {
        let Some(place) = self.place(index, facet, polygon) else { return (DVec3::ZERO, DVec3::ZERO, 1.0) };
        let known = self.colour_and_opacity(&place);
        let (reflectance, opacity) = self.reflectance_and_opacity(&place, &known);
        (reflectance, self.exitance_at(&place, || known.1), opacity)
    }

    fn reflectance_and_opacity(
        &self,
        place: &Place,
        (colour, opacity): &(DVec3, MeanOpacity),
    ) -> (DVec3, f64) {
        let pattern = &self.pattern;
        let rest = pattern.dimming.as_ref().map_or(DVec3::ONE, |layer| place.mean(layer).truncate());
        // The image's texels have their opacity in them; what the vertices bring is known apart from it.
        let diffuse = pattern.reflectance * *colour * rest * opacity.of_vertices;
        let left = match (&pattern.transmitting, &pattern.reflecting) {
            (None, _) => DVec3::splat(1.0 - pattern.transmission),
            (Some(layer), Some(whole)) if pattern.transmitting_has_colour => {
                let (left, whole) = (place.mean(layer).truncate(), place.mean(whole).truncate());
                DVec3::select(whole.cmpgt(DVec3::ZERO), left / whole, DVec3::ONE)
            }
            (Some(layer), _) => place.mean(layer).truncate(),
        };
        pattern.with_transmission(diffuse, left, opacity.all())
    }

    fn exitance_at(&self, place: &Place, opacity: impl FnOnce() -> MeanOpacity) -> DVec3 {
        if self.pattern.exitance == DVec3::ZERO {
            return DVec3::ZERO;
        }
        let emission =
            self.pattern.emitting.as_ref().map_or(DVec3::ONE, |layer| place.mean(layer).truncate());
        let opacity = match self.pattern.opacity {
            Opacity::Opaque => 1.0,
            _ if self.pattern.emitting_has_opacity => opacity().of_vertices,
            _ => opacity().all(),
        };
        self.pattern.exitance * emission * opacity
    }

    /// True where the exitance is the same all over the surface.
    #[must_use]
    pub fn emits_evenly(&self) -> bool {
        self.pattern.exitance == DVec3::ZERO
            || (self.pattern.emitting.is_none() && self.pattern.opacity == Opacity::Opaque)
    }

    /// True where the surface reflects all channels alike, everywhere.
    #[must_use]
    pub fn reflects_grey(&self) -> bool {
        let factor = self.pattern.reflectance;
        let is_grey_layer = |layer: &Option<Layer>| layer.as_ref().is_none_or(|layer| layer.image.is_grey());
        let is_grey_vertex = |[red, green, blue, _]: &[f32; 4]| red == green && red == blue;
        factor == DVec3::splat(factor.x)
            && is_grey_layer(&self.pattern.reflecting)
            && self.vertices.colours.iter().flatten().all(is_grey_vertex)
    }

    /// True where all that the surface emits has one colour.
    #[must_use]
    pub fn emits_one_colour(&self) -> bool {
        let is_grey = |layer: &Layer| layer.image.is_grey();
        self.pattern.exitance == DVec3::ZERO || self.pattern.emitting.as_ref().is_none_or(is_grey)
    }

    /// Colour without its factor, with the image's opacity in it.
    fn colour_and_opacity(&self, place: &Place) -> (DVec3, MeanOpacity) {
        let image = self.pattern.reflecting.as_ref().map_or(DVec4::ONE, |layer| place.mean(layer));
        let vertices = place.mean_colour();
        let alpha = match self.pattern.reflecting {
            Some(ref layer) if layer.image.raster().has_alpha() => Some(image.w),
            _ => None,
        };
        let of_vertices = match (self.pattern.opacity, alpha) {
            (Opacity::Opaque, _) => 1.0,
            (Opacity::Blend { .. }, Some(_)) => vertices.w.clamp(0.0, 1.0),
            // The image was decided texel by texel, and the vertices may take away what it left.
            (Opacity::Mask { cutoff, .. }, Some(_)) => f64::from(u8::from(vertices.w >= cutoff)),
            (opacity, None) => opacity.of(vertices.w),
        };
        (image.truncate() * vertices.truncate(), MeanOpacity { of_image: alpha.unwrap_or(1.0), of_vertices })
    }

    fn place<'a>(&'a self, index: u32, facet: &'a Facet, polygon: &'a [DVec3]) -> Option<Place<'a>> {
        let triangle = facet.triangles.get(*self.largest.get(index as usize)? as usize)?;
        Some(Place { vertices: &self.vertices, triangle, polygon })
    }
}

/// The largest triangle of each facet.
fn largest_triangles(facets: &[Facet]) -> Vec<u32> {
    let area = |triangle: &SourceTriangle| area_vector(&triangle.positions).length_squared();
    let largest = |facet: &Facet| {
        let best = (0..facet.triangles.len())
            .reduce(|a, b| if area(&facet.triangles[b]) > area(&facet.triangles[a]) { b } else { a });
        best.unwrap_or(0) as u32
    };
    facets.iter().map(largest).collect()
}

/// Mean opacity of the image and of what the vertices and the factor bring.
struct MeanOpacity {
    of_image: f64,
    of_vertices: f64,
}

impl MeanOpacity {
    fn all(&self) -> f64 {
        (self.of_image * self.of_vertices).min(1.0)
    }
}

/// A polygon, and the triangle that tells what its points have.
struct Place<'a> {
    vertices: &'a VertexValues,
    triangle: &'a SourceTriangle,
    polygon: &'a [DVec3],
}

impl Place<'_> {
    /// Weights of the triangle's corners at a point of its plane.
    fn weights(&self, point: DVec3) -> DVec3 {
        let [a, b, c] = self.triangle.positions;
        let normal = (b - a).cross(c - a);
        let way = point - a;
        let second = (c - a).cross(normal).dot(way) / normal.length_squared();
        let third = normal.cross(b - a).dot(way) / normal.length_squared();
        DVec3::new(1.0 - second - third, second, third)
    }

    /// Place on the image at a point.
    fn coordinates(&self, mapping: &Mapping, point: DVec3) -> DVec2 {
        let Some(set) = self.vertices.set(mapping.set) else {
            return mapping.transform.transform_point2(DVec2::ZERO);
        };
        let weights = self.weights(point).to_array();
        let corner = |vertex: u32| set.get(vertex as usize).copied().unwrap_or_default().map(f64::from);
        let own = self.triangle.vertices.into_iter().zip(weights);
        mapping
            .transform
            .transform_point2(own.map(|(vertex, weight)| DVec2::from_array(corner(vertex)) * weight).sum())
    }

    /// Mean of an image over the polygon; of a single point, or a polygon that is none on the image, by points.
    fn mean(&self, layer: &Layer) -> DVec4 {
        let uv: Vec<DVec2> =
            self.polygon.iter().map(|point| self.coordinates(&layer.mapping, *point)).collect();
        let sampler = &layer.mapping.sampler;
        if let Some(mean) = layer.image.over(&uv, sampler) {
            return mean;
        }
        let Some(first) = uv.first() else { return DVec4::ZERO };
        if uv.iter().all(|other| other.distance(*first) <= ONE_PLACE) {
            return layer.image.at(*first, sampler);
        }
        let samples = samples(self.polygon);
        let all: f64 = samples.iter().map(|(_, weight)| weight).sum();
        let at = |point| layer.image.at(self.coordinates(&layer.mapping, point), sampler);
        samples.into_iter().map(|(point, weight)| at(point) * (weight / all)).sum()
    }

    /// Mean of the vertex colours: that at the polygon's centre of gravity, since they are affine.
    fn mean_colour(&self) -> DVec4 {
        let Some(colours) = &self.vertices.colours else { return DVec4::ONE };
        let weights = self.weights(centre_of_gravity(self.polygon)).to_array();
        let corner = |vertex: u32| {
            let colour = colours.get(vertex as usize).copied().unwrap_or([1.0; 4]);
            DVec4::from_array(colour.map(f64::from))
        };
        let own = self.triangle.vertices.into_iter().zip(weights);
        own.map(|(vertex, weight)| corner(vertex) * weight).sum::<DVec4>().max(DVec4::ZERO)
    }
}

/// Triangles around the first corner, with their areas.
fn fan(polygon: &[DVec3]) -> impl Iterator<Item = ([DVec3; 3], f64)> {
    (2..polygon.len()).map(|i| {
        let corners = [polygon[0], polygon[i - 1], polygon[i]];
        (corners, area_vector(&corners).length())
    })
}

fn centre_of_gravity(polygon: &[DVec3]) -> DVec3 {
    let area: f64 = fan(polygon).map(|(_, area)| area).sum();
    if area > 0.0 {
        return fan(polygon)
            .map(|(corners, area)| corners.into_iter().sum::<DVec3>() * (area / 3.0))
            .sum::<DVec3>()
            / area;
    }
    polygon.iter().sum::<DVec3>() / polygon.len().max(1) as f64
}

/// Points of a polygon with the area that each stands for.
fn samples(polygon: &[DVec3]) -> Vec<(DVec3, f64)> {
    if fan(polygon).all(|(_, area)| area == 0.0) {
        return vec![(centre_of_gravity(polygon), 1.0)];
    }
    let step = 1.0 / SAMPLES_ALONG_SIDE as f64;
    let in_triangle = |([a, b, c], area): ([DVec3; 3], f64)| {
        let at = move |u: f64, v: f64| a + (b - a) * (u * step) + (c - a) * (v * step);
        (0..SAMPLES_ALONG_SIDE).flat_map(move |row| {
            let upright =
                (0..SAMPLES_ALONG_SIDE - row).map(move |u| (u as f64 + 1.0 / 3.0, row as f64 + 1.0 / 3.0));
            let turned = (0..SAMPLES_ALONG_SIDE - row - 1)
                .map(move |u| (u as f64 + 2.0 / 3.0, row as f64 + 2.0 / 3.0));
            upright.chain(turned).map(move |(u, v)| (at(u, v), area * step * step))
        })
    };
    fan(polygon).flat_map(in_triangle).collect()
}

#[cfg(test)]
mod tests;
