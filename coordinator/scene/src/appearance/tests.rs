//! Means over polygons of facets.

use glam::DAffine2;
use kernel::geometry::PlaneId;

use super::*;
use crate::facet::{Corner, Facet};
use document::texture::{Image, Sampler};

/// The square from (0, 0) to (2, 2) in the plane z = 1, of two triangles, whose image lies on it once.
fn facet() -> Facet {
    let at = |x: f64, y: f64| DVec3::new(x, y, 1.0);
    let corners = [at(0.0, 0.0), at(2.0, 0.0), at(2.0, 2.0), at(0.0, 2.0)];
    let triangle = |vertices: [u32; 3]| SourceTriangle {
        vertices,
        positions: vertices.map(|vertex| corners[vertex as usize]),
    };
    Facet {
        plane: PlaneId(0),
        normal: DVec3::Z,
        corners: corners.map(|position| Corner { position, normal: DVec3::Z }).to_vec(),
        triangles: vec![triangle([0, 1, 2]), triangle([0, 2, 3])],
        is_sealed: false,
    }
}

const COORDINATES: [[f32; 2]; 4] = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];

fn rectangle(low: [f64; 2], high: [f64; 2]) -> Vec<DVec3> {
    let at = |x: f64, y: f64| DVec3::new(x, y, 1.0);
    vec![at(low[0], low[1]), at(high[0], low[1]), at(high[0], high[1]), at(low[0], high[1])]
}

/// Black on the left, white on the right; alpha 0 above and 255 below.
fn layer(opacity: Opacity) -> Layer {
    let texels = vec![[0, 0, 0, 0], [255, 255, 255, 0], [0, 0, 0, 255], [255, 255, 255, 255]];
    let image = Arc::new(Image::new(2, 2, texels).unwrap());
    let alpha = (opacity != Opacity::Opaque).then(|| (image.clone(), opacity));
    let composed = Composed::new(Some(image), vec![], alpha);
    let sampler = Sampler { filter: document::texture::Filter::Nearest, ..Sampler::default() };
    let mapping = Mapping { set: 0, transform: DAffine2::IDENTITY, sampler };
    Layer { image: Arc::new(AreaMeans::new(composed)), mapping }
}

fn pattern(opacity: Opacity) -> Pattern {
    Pattern {
        reflecting: Some(layer(opacity)),
        dimming: None,
        transmitting: None,
        transmitting_has_colour: false,
        emitting: None,
        emitting_has_opacity: false,
        reflectance: DVec3::new(0.5, 0.25, 0.125),
        exitance: DVec3::ZERO,
        opacity,
        transmission: 0.0,
    }
}

fn appearance(pattern: Pattern, colours: Option<Vec<[f32; 4]>>) -> Appearance {
    let vertices = VertexValues { coordinates: vec![(0, COORDINATES.to_vec())], colours };
    Appearance::new(Arc::new(pattern), vertices, &[facet()])
}

#[track_caller]
fn assert_near(found: DVec3, expected: DVec3) {
    assert!((found - expected).abs().max_element() < 1e-12, "{found} is not {expected}");
}

#[test]
fn images_lie_as_the_coordinates_say() {
    let (facet, appearance) = (facet(), appearance(pattern(Opacity::Opaque), None));
    let over = |low, high| appearance.reflectance(0, &facet, &rectangle(low, high));
    let factor = DVec3::new(0.5, 0.25, 0.125);
    assert_near(over([0.0, 0.0], [2.0, 2.0]), factor / 2.0);
    assert_near(over([0.0, 0.0], [1.0, 2.0]), DVec3::ZERO);
    assert_near(over([1.0, 0.5], [2.0, 0.7]), factor);
    assert_near(over([0.5, 0.0], [1.25, 2.0]), factor / 3.0);
    assert_near(appearance.reflectance(0, &facet, &[DVec3::new(1.7, 0.3, 1.0)]), factor);
    assert_eq!(appearance.opacity(0, &facet, &rectangle([0.0; 2], [1.0; 2])), 1.0);
}

#[test]
fn holes_reflect_nothing() {
    let mask = Opacity::Mask { factor: 1.0, cutoff: 0.5 };
    let (facet, appearance) = (facet(), appearance(pattern(mask), None));
    // v points down: the lower half of the image is that of the square.
    let (upper, lower) = (rectangle([0.0, 1.0], [2.0, 2.0]), rectangle([0.0, 0.0], [2.0, 1.0]));
    assert_near(appearance.reflectance(0, &facet, &upper), DVec3::ZERO);
    assert_near(appearance.reflectance(0, &facet, &lower), DVec3::new(0.25, 0.125, 0.0625));
    assert_eq!([&upper, &lower].map(|half| appearance.opacity(0, &facet, half)), [0.0, 1.0]);
    assert!((appearance.opacity(0, &facet, &rectangle([0.0; 2], [2.0; 2])) - 0.5).abs() < 1e-12);
}

#[test]
fn vertex_colours_are_affine() {
    let colours =
        vec![[0.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0], [0.0, 1.0, 1.0, 0.0]];
    let plain = |opacity| Pattern { reflecting: None, ..pattern(opacity) };
    let (facet, whole) = (facet(), rectangle([0.0; 2], [2.0; 2]));
    let opaque = appearance(plain(Opacity::Opaque), Some(colours.clone()));
    assert_near(opaque.reflectance(0, &facet, &whole), DVec3::new(0.25, 0.25, 0.125));
    let part = rectangle([1.0, 0.0], [2.0, 2.0]);
    assert_near(opaque.reflectance(0, &facet, &part), DVec3::new(0.375, 0.25, 0.125));
    // Half of it is there: so it reflects half.
    let blended = appearance(plain(Opacity::Blend { factor: 1.0 }), Some(colours));
    assert!((blended.opacity(0, &facet, &whole) - 0.5).abs() < 1e-12);
    assert_near(blended.reflectance(0, &facet, &whole), DVec3::new(0.125, 0.125, 0.0625));
}

#[test]
fn emission_is_a_pattern_of_its_own() {
    let emitting = Pattern {
        emitting: Some(layer(Opacity::Opaque)),
        exitance: DVec3::splat(4.0),
        ..pattern(Opacity::Blend { factor: 0.5 })
    };
    let (facet, appearance) = (facet(), appearance(emitting, None));
    // White on the right, half opaque below; what does not share texels is multiplied as means.
    assert_near(appearance.exitance(0, &facet, &rectangle([1.0, 0.0], [2.0, 1.0])), DVec3::splat(2.0));
    assert_near(appearance.exitance(0, &facet, &rectangle([0.0, 0.0], [2.0, 2.0])), DVec3::splat(0.5));
    assert!(!appearance.emits_evenly() && appearance.emits_one_colour());
    assert!(!appearance.reflects_grey());
}

#[test]
fn polygons_that_are_points_or_lines_on_the_image_have_a_mean() {
    let facet = facet();
    let squeezed = |coordinates: [[f32; 2]; 4]| {
        let vertices = VertexValues { coordinates: vec![(0, coordinates.to_vec())], colours: None };
        let appearance =
            Appearance::new(Arc::new(pattern(Opacity::Opaque)), vertices, std::slice::from_ref(&facet));
        appearance.reflectance(0, &facet, &rectangle([0.0; 2], [2.0; 2])).x
    };
    assert_eq!(squeezed([[0.75, 0.5]; 4]), 0.5);
    assert_eq!(squeezed([[0.25, 0.5]; 4]), 0.0);
    let line = squeezed([[0.0, 0.25], [1.0, 0.25], [1.0, 0.25], [0.0, 0.25]]);
    assert!((line - 0.25).abs() < 0.03, "{line}");
    assert_eq!(squeezed([[f32::NAN; 2]; 4]), 0.0);
}

#[test]
fn reflectance_stays_below_one() {
    let bright = Pattern { reflectance: DVec3::new(7.0, 1.0, 0.5), ..pattern(Opacity::Opaque) };
    let found = appearance(bright, None).reflectance(0, &facet(), &rectangle([1.0, 0.0], [2.0, 2.0]));
    assert_near(found, DVec3::new(MAX_REFLECTANCE, MAX_REFLECTANCE, 0.5));
}
