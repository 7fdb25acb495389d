//! Scenes whose triangles are the trouble.

use std::f64::consts::TAU;

use glam::{DMat4, DQuat, DVec3};

use super::{Family, ROOM, material, room};
use crate::builder::{Material, SceneBuilder};
use crate::numbers::Numbers;
use crate::shapes::{Polygon, box_facing_in, box_facing_out, icosphere, turned};

/// The scene of a family, of about so many triangles at most.
pub(super) fn scene(family: Family, numbers: &mut Numbers, triangles: usize) -> SceneBuilder {
    match family {
        Family::Layers => layers(numbers, triangles),
        Family::Coplanar => coplanar(numbers, triangles),
        Family::Slivers => one_part(numbers, "slivers", triangles, slivers),
        Family::Shells => shells(numbers, triangles),
        Family::Fans => one_part(numbers, "fan", triangles, fan),
        Family::Needles => one_part(numbers, "needles", triangles, needles),
        Family::Sizes => sizes(numbers, triangles),
        Family::Crumbs => one_part(numbers, "crumbs", triangles, crumbs),
        _ => one_part(numbers, "soup", triangles, soup),
    }
}

/// A room with one part made of so many triangles.
fn one_part(
    numbers: &mut Numbers,
    name: &str,
    triangles: usize,
    make: fn(&mut Numbers, usize) -> Vec<Polygon>,
) -> SceneBuilder {
    let count = (numbers.magnitude(2.0, triangles as f64 + 1.0) as usize).max(2);
    let polygons = make(numbers, count);
    let material = material(numbers);
    room(numbers).part(name, &polygons, material)
}

/// A point of the room, off its walls.
fn inside(numbers: &mut Numbers) -> DVec3 {
    numbers.point(DVec3::splat(0.05), ROOM - 0.05)
}

/// The point of the room that is nearest.
fn into_room(point: DVec3) -> DVec3 {
    point.clamp(DVec3::splat(0.001), ROOM - 0.001)
}

/// Sheets on one another, each a part of its own; all as far apart, or at random distances, or on a wall.
fn layers(numbers: &mut Numbers, triangles: usize) -> SceneBuilder {
    let count = 2 + numbers.below((triangles / 2).clamp(1, 99));
    let gap = if numbers.chance(0.1) { 0.0 } else { numbers.magnitude(1e-7, 1e-4) };
    let aside = if numbers.chance(0.3) { 0.0 } else { numbers.magnitude(1e-8, 0.1) };
    let is_uneven = numbers.chance(0.5);
    let mut height = if numbers.chance(0.3) { gap } else { numbers.between(0.2, 2.0) };
    let tilt = if numbers.chance(0.5) { 0.0 } else { numbers.magnitude(1e-7, 1e-3) };
    let rotation = if numbers.chance(0.5) {
        DMat4::IDENTITY
    } else {
        let turn = DQuat::from_axis_angle(numbers.direction(), numbers.between(0.0, TAU));
        let middle = DMat4::from_translation(ROOM / 2.0);
        // Small enough to stay in the room.
        middle
            * DMat4::from_scale_rotation_translation(DVec3::splat(0.4), turn, DVec3::ZERO)
            * middle.inverse()
    };
    let mut builder = room(numbers);
    for index in 0..count {
        let aside = (aside * index as f64).min(0.4);
        let corners = [[0.5, 0.5], [2.5, 0.5], [2.5, 2.5], [0.5, 2.5]];
        let sheet = corners.map(|[x, y]| DVec3::new(x + aside, y, height + tilt * x * numbers.part()));
        let mut sheet = sheet.to_vec();
        if numbers.chance(0.2) {
            sheet.reverse();
        }
        let material = material(numbers);
        builder = builder.part(&format!("sheet {index}"), &[sheet], material).placed(rotation);
        height += if is_uneven { gap * 2.0 * numbers.part() } else { gap };
    }
    builder
}

/// Triangles in a few planes, overlapping at will, a hair off them or not.
fn coplanar(numbers: &mut Numbers, triangles: usize) -> SceneBuilder {
    let count = (numbers.magnitude(2.0, triangles as f64 + 1.0) as usize).max(2);
    let planes = 1 + numbers.below(3);
    let off = if numbers.chance(0.5) { 0.0 } else { numbers.magnitude(1e-8, 1e-4) };
    let size = numbers.magnitude(0.05, 3.0);
    let parts = 1 + numbers.below(4);
    let mut builder = room(numbers);
    for part in 0..parts {
        let polygons: Vec<Polygon> = (0..count.div_ceil(parts))
            .map(|_| {
                let height = 0.5 + numbers.below(planes) as f64 + off * numbers.part();
                let middle = inside(numbers);
                let mut corner = || {
                    let corner = middle + size * numbers.point(DVec3::splat(-0.5), DVec3::splat(0.5));
                    into_room(corner).with_z(height)
                };
                vec![corner(), corner(), corner()]
            })
            .collect();
        let material = material(numbers);
        builder = builder.part(&format!("triangles {part}"), &polygons, material);
    }
    builder
}

fn slivers(numbers: &mut Numbers, count: usize) -> Vec<Polygon> {
    let (from, to) = (inside(numbers), inside(numbers));
    let least = numbers.magnitude(1e-9, 1e-3);
    let together = numbers.chance(0.5);
    let spread = numbers.magnitude(1e-6, 1.0);
    let sliver = |_| {
        let (a, b) = if together {
            let mut near = |point: DVec3| into_room(point + spread * numbers.direction());
            (near(from), near(to))
        } else {
            (inside(numbers), inside(numbers))
        };
        let part = numbers.of(&[0.0, 0.5, 1.0, 1e-6]);
        let height = numbers.magnitude(least, 10.0 * least);
        vec![a, b, into_room(a.lerp(b, part) + height * numbers.direction())]
    };
    (0..count).map(sliver).collect()
}

/// Around one point: flat, or a cone; or all at one edge.
fn fan(numbers: &mut Numbers, count: usize) -> Vec<Polygon> {
    let middle = ROOM / 2.0 + 0.3 * numbers.direction();
    let (u, v) = numbers.direction().any_orthonormal_pair();
    let axis = u.cross(v);
    let radius = numbers.magnitude(0.01, 1.1);
    let rise = numbers.of(&[0.0, 0.0, 1e-7, 1e-3, 0.5]);
    let rim = |index: usize| {
        let (sine, cosine) = (TAU * index as f64 / count as f64).sin_cos();
        middle
            + radius * (u * cosine + v * sine)
            + rise * radius * axis * if index.is_multiple_of(2) { 1.0 } else { -1.0 }
    };
    if numbers.chance(0.4) {
        // At one edge, the axis.
        let (foot, head) = (middle - 0.3 * axis, middle + 0.3 * axis);
        (0..count).map(|index| vec![foot, head, rim(index)]).collect()
    } else {
        (0..count).map(|index| vec![middle, rim(index), rim(index + 1)]).collect()
    }
}

fn needles(numbers: &mut Numbers, count: usize) -> Vec<Polygon> {
    let thin = numbers.magnitude(1e-7, 0.01);
    let beyond = numbers.chance(0.3);
    let needle = |_| {
        let (a, b) = (inside(numbers), inside(numbers));
        // Through the walls.
        let (a, b) = if beyond { (a + 2.0 * (a - b), b + 2.0 * (b - a)) } else { (a, b) };
        vec![a, b, b + thin * numbers.direction()]
    };
    (0..count).map(needle).collect()
}

fn soup(numbers: &mut Numbers, count: usize) -> Vec<Polygon> {
    let size = numbers.magnitude(0.02, 2.0);
    let triangle = |_| {
        let middle = inside(numbers);
        let mut corner = || into_room(middle + size * numbers.point(DVec3::splat(-0.5), DVec3::splat(0.5)));
        vec![corner(), corner(), corner()]
    };
    (0..count).map(triangle).collect()
}

fn crumbs(numbers: &mut Numbers, count: usize) -> Vec<Polygon> {
    let size = numbers.magnitude(1e-5, 1e-2);
    let crumb = |_| {
        let (at, (u, v)) = (inside(numbers), numbers.direction().any_orthonormal_pair());
        vec![at, at + size * u, at + size * v]
    };
    (0..count).map(crumb).collect()
}

/// Boxes or balls in one another, the outermost around the lamp or not.
fn shells(numbers: &mut Numbers, triangles: usize) -> SceneBuilder {
    let levels = numbers.below(3) as u32;
    let is_ball = numbers.chance(0.5);
    let each = if is_ball { 20 << (2 * levels) } else { 12 };
    let count = (2 + numbers.below(99)).min((triangles / each).max(2));
    let gap = numbers.magnitude(1e-7, 0.05);
    let around_lamp = numbers.chance(0.3);
    let (middle, largest) = if around_lamp {
        (DVec3::new(1.5, 1.5, 2.0), 0.95)
    } else {
        (DVec3::new(1.5, 1.5, 0.9), numbers.between(0.3, 0.8))
    };
    let mut builder = room(numbers);
    for index in 0..count {
        let radius = largest - (gap * index as f64).min(0.9 * largest);
        let shell: Vec<Polygon> = if is_ball {
            let face = |face: [DVec3; 3]| face.map(|corner| middle + radius * corner).to_vec();
            icosphere(levels).into_iter().map(face).collect()
        } else {
            box_facing_out(middle - radius, middle + radius)
        };
        let shell = if numbers.chance(0.5) { turned(&shell) } else { shell };
        let material = material(numbers);
        builder = builder.part(&format!("shell {index}"), &shell, material);
    }
    builder
}

/// Boxes from a millionth of the room to all of it, far from the origin or not.
fn sizes(numbers: &mut Numbers, triangles: usize) -> SceneBuilder {
    let count = 1 + numbers.below((triangles / 12).clamp(1, 200));
    let (large, far) = (numbers.of(&[1e-6, 1e-3, 1.0, 1e3, 1e6]), numbers.of(&[0.0, 0.0, 1e2, 1e4]));
    let mut builder = room(numbers);
    for index in 0..count {
        let half = numbers.magnitude(1e-6, 1.0) * DVec3::new(1.0, numbers.magnitude(1e-3, 1.0), 1.0);
        let turn = DQuat::from_axis_angle(numbers.direction(), numbers.between(0.0, TAU));
        let at = numbers.point(DVec3::splat(0.1), ROOM - 0.1);
        let material = material(numbers);
        let name = format!("box {index}");
        builder = builder
            .part(&name, &box_facing_out(-half / 2.0, half / 2.0), material)
            .placed(DMat4::from_rotation_translation(turn, at));
    }
    if numbers.chance(0.3) {
        // A hall a thousand times as large around it all.
        let hall = box_facing_in(DVec3::splat(-1e3), DVec3::splat(1e3));
        builder = builder.part("hall", &hall, Material::grey(0.5));
    }
    builder.all_placed(DMat4::from_scale_rotation_translation(
        DVec3::splat(large),
        DQuat::IDENTITY,
        far * large * DVec3::ONE,
    ))
}
