use std::f64::consts::PI;

use crate::picture::{Alpha, Camera, Encoding, Projection, Texture, Wrap, decode_picture, encode_picture};

use super::*;

const NO_LIGHT: DVec3 = DVec3::ZERO;

/// A square of 200 about the z axis, seen from +z, of irradiance pi times its colour.
fn square(z: f64, colour: [f32; 4]) -> Part {
    let side = 100.0;
    Part {
        positions: vec![[-side, -side, z], [side, -side, z], [side, side, z], [-side, side, z]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        irradiance: vec![[std::f32::consts::PI; 3]; 4],
        base: colour,
        ..Part::default()
    }
}

fn picture(parts: Vec<Part>) -> Picture {
    Picture::new(PictureScene { parts, images: vec![], rounding: 0.0 })
}

fn down(x: f64, y: f64) -> Ray {
    Ray { origin: DVec3::new(x, y, 500.0), direction: DVec3::NEG_Z, start: 0.0 }
}

fn seen(picture: &Picture, background: DVec3) -> DVec3 {
    picture.radiance(&down(3.0, 4.0), background).0
}

fn assert_near(found: DVec3, expected: [f64; 3]) {
    assert!((found - DVec3::from_array(expected)).abs().max_element() < 1e-6, "{found}");
}

#[test]
fn radiance_is_reflectance_times_irradiance_over_pi_and_emission() {
    let mut part = square(0.0, [0.5, 0.25, 0.125, 1.0]);
    part.irradiance = (0..4).map(|_| [2.0, 4.0, 8.0]).collect();
    part.emission = [0.0, 1.0, 2.0];
    let expected = [1.0 / PI, 1.0 / PI + 1.0, 1.0 / PI + 2.0];
    assert_near(seen(&picture(vec![part.clone()]), NO_LIGHT), expected);
    part.irradiance.clear();
    assert_near(seen(&picture(vec![part]), NO_LIGHT), [0.0, 1.0, 2.0]);
}

#[test]
fn light_is_interpolated_between_the_vertices() {
    let mut part = square(0.0, [1.0; 4]);
    // Irradiance pi x / 100 + pi.
    let pi = std::f32::consts::PI;
    part.irradiance = [0.0, 2.0, 2.0, 0.0].map(|value| [value * pi; 3]).to_vec();
    let picture = picture(vec![part]);
    for (x, y) in [(-50.0, 20.0), (0.0, 0.0), (80.0, -30.0)] {
        assert_near(picture.radiance(&down(x, y), NO_LIGHT).0, [1.0 + x / 100.0; 3]);
    }
}

#[test]
fn a_lightmap_multiplies_the_irradiance_of_the_vertices() {
    let pixels = vec![255, 255, 255, 255, 255, 0, 51, 51].into();
    let image = Image { width: 2, height: 1, encoding: Encoding::Rgbm, pixels };
    let mut part = square(0.0, [0.5, 0.25, 1.0, 1.0]);
    part.irradiance = vec![[2.0 * std::f32::consts::PI; 3]; 4];
    part.irradiance_texture = Some(Texture { image: 0, wrap: [Wrap::Clamp; 2], nearest: false });
    part.irradiance_coordinates = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let picture = Picture::new(PictureScene { parts: vec![part], images: vec![image], rounding: 0.0 });
    assert_near(picture.radiance(&down(-90.0, 5.0), NO_LIGHT).0, [1.0, 0.5, 2.0]);
    assert_near(picture.radiance(&down(90.0, 5.0), NO_LIGHT).0, [0.2, 0.0, 0.08]);
}

#[test]
fn backs_are_not_seen_unless_both_sides_are() {
    let mut part = square(0.0, [1.0; 4]);
    part.triangles.iter_mut().for_each(|triangle| triangle.reverse());
    let background = DVec3::new(0.0, 0.0, 7.0);
    assert_eq!(seen(&picture(vec![part.clone()]), background), background);
    part.double_sided = true;
    assert_near(seen(&picture(vec![part]), background), [1.0; 3]);
}

#[test]
fn blended_surfaces_are_laid_over_each_other_nearest_first() {
    let glass = |z, colour| Part { alpha: Alpha::Blend, ..square(z, colour) };
    let parts = vec![
        square(0.0, [0.0, 0.0, 1.0, 0.3]),
        glass(20.0, [1.0, 0.0, 0.0, 0.5]),
        glass(10.0, [0.0, 1.0, 0.0, 0.5]),
    ];
    // The alpha of an opaque surface means nothing.
    assert_near(seen(&picture(parts), DVec3::ONE), [0.5, 0.25, 0.25]);
    let one = vec![glass(0.0, [1.0, 0.0, 0.0, 0.25])];
    assert_near(seen(&picture(one), DVec3::splat(4.0)), [3.25, 3.0, 3.0]);
    // Where a ray meets both triangles of an edge there is one surface.
    let one = picture(vec![glass(0.0, [1.0, 0.0, 0.0, 0.5])]);
    assert_near(one.radiance(&down(7.0, 7.0), NO_LIGHT).0, [0.5, 0.0, 0.0]);
    // Of two surfaces in one place both are seen.
    let same = vec![glass(0.0, [1.0, 0.0, 0.0, 0.5]), glass(0.0, [1.0, 0.0, 0.0, 0.5])];
    assert_near(seen(&picture(same), NO_LIGHT), [0.75, 0.0, 0.0]);
}

#[test]
fn a_mask_cuts_holes_where_its_texture_says() {
    let image = Image {
        width: 2,
        height: 1,
        pixels: vec![255, 255, 255, 255, 255, 255, 255, 0].into(),
        encoding: Encoding::Srgb,
    };
    let texture = Texture { image: 0, wrap: [Wrap::Clamp; 2], nearest: false };
    let part = Part {
        alpha: Alpha::Mask(0.5),
        base_texture: Some(texture),
        base_coordinates: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        ..square(0.0, [1.0; 4])
    };
    let parts = vec![part, square(-10.0, [0.0, 1.0, 0.0, 1.0])];
    let picture = Picture::new(PictureScene { parts, images: vec![image], rounding: 0.0 });
    for x in [-90.0, -51.0, -1.0] {
        assert_near(picture.radiance(&down(x, 0.0), NO_LIGHT).0, [1.0; 3]);
        assert_eq!(picture.first_surface(&down(x, 0.0)).unwrap().0, 0);
    }
    for x in [1.0, 51.0, 90.0] {
        assert_near(picture.radiance(&down(x, 0.0), NO_LIGHT).0, [0.0, 1.0, 0.0]);
        assert_eq!(picture.first_surface(&down(x, 0.0)).unwrap().0, 1);
    }
}

#[test]
fn vertex_colours_and_textures_multiply() {
    let image =
        Image { width: 1, height: 1, pixels: vec![255, 0, 255, 255].into(), encoding: Encoding::Srgb };
    let texture = Texture { image: 0, wrap: [Wrap::Repeat; 2], nearest: false };
    let part = Part {
        colours: vec![[0.5, 0.5, 0.25, 1.0]; 4],
        base_texture: Some(texture),
        base_coordinates: vec![[0.0; 2]; 4],
        emission: [1.0, 2.0, 3.0],
        emission_texture: Some(texture),
        emission_coordinates: vec![[0.0; 2]; 4],
        ..square(0.0, [0.5, 1.0, 1.0, 1.0])
    };
    let picture = Picture::new(PictureScene { parts: vec![part], images: vec![image], rounding: 0.0 });
    assert_near(seen(&picture, NO_LIGHT), [1.25, 0.0, 3.25]);
}

/// A closed box, seen from inside, its sides cut into n x n squares; `parts` of its own, as nodes of a file are.
fn closed_box(n: u32) -> Vec<Part> {
    let mut parts = vec![];
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let at = |u: u32, v: u32| {
                let mut position = [0.0; 3];
                // Numbers that no binary fraction holds.
                position[axis] = sign * 301.7;
                position[(axis + 1) % 3] = 603.4 * f64::from(u) / f64::from(n) - 301.7;
                position[(axis + 2) % 3] = 603.4 * f64::from(v) / f64::from(n) - 301.7;
                position
            };
            let mut part = Part {
                positions: (0..=n).flat_map(|v| (0..=n).map(move |u| at(u, v))).collect(),
                emission: [1.0; 3],
                ..Part::default()
            };
            for corner in (0..n).flat_map(|v| (0..n).map(move |u| v * (n + 1) + u)) {
                let [a, b, c, d] = [corner, corner + 1, corner + n + 2, corner + n + 1];
                let faces_inward = [[a, c, b], [a, d, c]];
                part.triangles.extend(if sign > 0.0 {
                    faces_inward
                } else {
                    faces_inward.map(|[a, b, c]| [a, c, b])
                });
            }
            parts.push(part);
        }
    }
    parts
}

/// Rays from inside a closed box that see its outside.
fn leaks(picture: &Picture, n: u32) -> usize {
    let eye = DVec3::new(20.0, -31.0, 57.0);
    let ray = |to: DVec3| Ray { origin: eye, direction: (to - eye).normalize(), start: 0.0 };
    let background = DVec3::new(5.0, 0.0, 0.0);
    let leaks = |to: DVec3| picture.radiance(&ray(to), background).0 != DVec3::ONE;
    let mut count = 0;
    // At all vertices and the middles of all edges, and at points between.
    for part in closed_box(2 * n) {
        count += part.positions.iter().filter(|to| leaks(DVec3::from_array(**to))).count();
    }
    for index in 0..40_000 {
        let place = [0, 1, 2].map(|axis| f64::from(sobol_burley::sample(index, axis, 7)) - 0.5);
        count += usize::from(leaks(eye + DVec3::from_array(place)));
    }
    count
}

#[test]
fn nothing_is_seen_through_the_seams_of_a_closed_room() {
    for n in [1, 2, 7, 10, 13, 16] {
        assert_eq!(leaks(&picture(closed_box(n)), n), 0, "{n}");
    }
}

#[test]
fn seams_of_walls_that_were_divided_differently_and_rounded_apart_are_closed() {
    let mut parts = closed_box(1);
    // Two walls of another division: their corners lie on edges of the others.
    parts.splice(0..2, closed_box(13).into_iter().take(2));
    let rounded = |value: f64| f64::from(value as f32);
    for part in &mut parts[2..4] {
        part.positions.iter_mut().for_each(|position| *position = position.map(rounded));
    }
    let rounding = 603.4 / f64::from(1 << 23);
    let picture = Picture::new(PictureScene { parts, images: vec![], rounding });
    assert_eq!(leaks(&picture, 13), 0);
}

#[test]
fn a_tile_is_a_part_of_the_picture_and_its_pixels_do_not_depend_on_it() {
    let picture = picture(closed_box(3).into_iter().chain([square(100.0, [0.5; 4])]).collect());
    let camera = Camera {
        eye: DVec3::new(0.0, 0.0, 290.0),
        right: DVec3::X,
        up: DVec3::Y,
        forward: DVec3::NEG_Z,
        projection: Projection::Perspective { half: [1.0, 0.75] },
        near: 0.0,
    };
    let whole = TileRequest {
        picture: crate::replica::Digest::of(b""),
        camera,
        size: [40, 30],
        corner: [0, 0],
        extent: [40, 30],
        samples: 5,
        background: NO_LIGHT,
    };
    let (pixels, rays) = picture.tile(&whole);
    assert_eq!((pixels.len(), rays), (1200, 6000));
    let (part, _) = picture.tile(&TileRequest { corner: [10, 7], extent: [9, 11], ..whole.clone() });
    let expected: Pixels = (7..18).flat_map(|y| pixels[y * 40 + 10..y * 40 + 19].to_vec()).collect();
    assert_eq!(part, expected);
    // The square is 190 away: its corner at 100 is at 0.526 of half the width.
    let [x, y] = camera.place(DVec3::new(100.0, 100.0, 100.0)).unwrap();
    let (x, y) = ((x * 40.0) as usize, (y * 30.0) as usize);
    let inside = pixels[(y + 1) * 40 + x - 1];
    let outside = pixels[(y - 1) * 40 + x + 1];
    assert!((inside[0] - 0.5).abs() < 1e-6 && outside == [1.0; 3], "{inside:?} {outside:?}");
}

#[test]
fn what_is_nearer_than_the_near_plane_is_not_seen() {
    let picture = picture(vec![square(0.0, [1.0; 4]), square(-10.0, [0.5; 4])]);
    let from = |start| Ray { start, ..down(0.0, 0.0) };
    assert_near(picture.radiance(&from(499.0), NO_LIGHT).0, [1.0; 3]);
    assert_near(picture.radiance(&from(501.0), NO_LIGHT).0, [0.5; 3]);
    assert_near(picture.radiance(&from(511.0), NO_LIGHT).0, [0.0; 3]);
}

#[test]
fn a_scene_of_nothing_is_background() {
    let background = DVec3::new(1.0, 2.0, 3.0);
    assert_eq!(seen(&picture(vec![]), background), background);
    let mut flat = square(0.0, [1.0; 4]);
    flat.triangles = vec![[0, 0, 1], [2, 2, 2]];
    assert_eq!(seen(&picture(vec![flat]), background), background);
}

#[test]
fn whatever_the_bytes_of_a_replica_it_is_refused_or_can_be_seen() {
    let pixels = vec![9, 200, 30, 255, 1, 2, 3, 90].into();
    let image = Image { width: 2, height: 1, encoding: Encoding::Srgb, pixels };
    let light = Image { encoding: Encoding::Rgbm, ..image.clone() };
    let texture = Texture { image: 0, wrap: [Wrap::Mirror, Wrap::Clamp], nearest: false };
    let coordinates = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let part = Part {
        alpha: Alpha::Blend,
        irradiance_texture: Some(Texture { image: 1, ..texture }),
        irradiance_coordinates: coordinates.clone(),
        base_texture: Some(texture),
        base_coordinates: coordinates,
        colours: vec![[0.5; 4]; 4],
        emission: [1.0; 3],
        double_sided: true,
        ..square(0.0, [1.0; 4])
    };
    let scene = PictureScene { parts: vec![part], images: vec![image, light], rounding: 1e-3 };
    let whole = encode_picture(&scene).bytes.to_vec();
    let random = |index: u32, axis| f64::from(sobol_burley::sample(index, axis, 5));
    let mut seen = 0;
    for index in 0..20_000 {
        let mut bytes = whole.clone();
        let place = (random(index, 0) * bytes.len() as f64) as usize;
        bytes[place] = (random(index, 1) * 256.0) as u8;
        if random(index, 2) < 0.1 {
            bytes.truncate(place);
        }
        let Ok(scene) = decode_picture(&bytes) else { continue };
        let picture = Picture::new(scene);
        for (x, y) in [(3.0, 4.0), (-60.0, 20.0)] {
            let (radiance, _) = picture.radiance(&down(x, y), DVec3::ONE);
            assert!(radiance.is_finite() && radiance.min_element() >= 0.0, "{radiance}");
        }
        seen += 1;
    }
    assert!(seen > 1000, "{seen}");
}
