//! The points of a reference.

use glam::DVec3;
use sobol_burley::sample_4d;

use super::hash::mix;
use super::solid::Solid;
use super::{Place, ReferenceError};
use crate::plain::{PlainMaterial, PlainScene, PlainTriangle};

/// How far a point may lie off its surface, as a share of the scene's extent: coordinates are rounded in the file.
const DISTANCE: f64 = 1e-4;

/// Points that one Sobol' sequence gives.
const SEQUENCE: usize = 1 << 16;

/// Tries for each point.
const MOST_TRIES: usize = 100;

/// Points uniform over the area of all sides that reflect, both of a double-sided surface, but for what lies under another layer in one
/// plane.
///
/// They are scrambled Sobol' points, so that they spread more evenly than independent ones; each by itself is uniform.
///
/// # Errors
/// When no surface reflects, or less than one in a hundred points of those that do is seen.
pub fn random(scene: &PlainScene, count: usize, seed: u64) -> Result<Vec<Place>, ReferenceError> {
    let mut total = 0.0;
    let mut sides = Vec::new();
    for (index, triangle) in scene.triangles.iter().enumerate() {
        let material = scene.materials[triangle.primitive];
        if material.reflectance == DVec3::ZERO {
            continue;
        }
        let area = triangle.area_vector();
        for sign in if material.double_sided { &[1.0, -1.0][..] } else { &[1.0][..] } {
            total += area.length();
            sides.push((total, index, *sign * area.normalize()));
        }
    }
    if sides.is_empty() {
        return Err(ReferenceError::NoReflection);
    }
    let solid = Solid::new(scene);
    let place = |index: usize| {
        let sequence = mix(seed, (index / SEQUENCE) as u64) as u32;
        let [first, second, u, v] = sample_4d((index % SEQUENCE) as u32, 0, sequence).map(f64::from);
        // Two draws, because the 24 bits of one would not tell small triangles apart in a large scene.
        let wanted = (first + second / f64::from(1 << 24)) * total;
        let (_, triangle, normal) =
            sides[sides.partition_point(|side| side.0 <= wanted).min(sides.len() - 1)];
        let PlainTriangle { corners, primitive, .. } = &scene.triangles[triangle];
        let position = point_of(corners, u, v);
        let is_seen = solid.is_seen(&solid.triangle(triangle), solid.frame.place(position), normal);
        is_seen.then_some(Place { position, normal, primitive: *primitive })
    };
    // One layer of each place is seen, but it may be one that does not reflect.
    let tries = count.saturating_mul(MOST_TRIES);
    let places: Vec<Place> = (0..tries).filter_map(place).take(count).collect();
    if places.len() < count {
        Err(ReferenceError::Hidden { places: places.len(), tries })
    } else {
        Ok(places)
    }
}

/// The place on the scene's surfaces that each of these places means: the nearest point of its primitive, and the normal of the
/// side there. `None` where there is none near, or where that side does not reflect.
#[must_use]
pub fn locate(scene: &PlainScene, places: &[Place]) -> Vec<Option<Place>> {
    let solid = Solid::new(scene);
    let distance = DISTANCE * solid.frame.scale;
    places
        .iter()
        .map(|place| {
            let material = scene.materials.get(place.primitive)?;
            let candidates = solid.near(place.position, distance).filter_map(|index| {
                let triangle = &scene.triangles[index];
                let front = triangle.area_vector().normalize();
                let cosine = front.dot(place.normal);
                let visible = cosine > 0.5 || (material.double_sided && cosine < -0.5);
                let position = nearest_point(&triangle.corners, place.position);
                let off = position.distance(place.position);
                (triangle.primitive == place.primitive && visible && off <= distance)
                    .then(|| (off, Place { position, normal: front * cosine.signum(), ..*place }))
            });
            candidates.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, place)| place)
        })
        .collect()
}

/// The materials at these places, each on a side of its primitive; without textures where no triangle is near.
#[must_use]
pub fn materials(scene: &PlainScene, places: &[Place]) -> Vec<PlainMaterial> {
    let solid = Solid::new(scene);
    places.iter().map(|place| material(scene, &solid, place)).collect()
}

/// The material at a place.
pub(super) fn material(scene: &PlainScene, solid: &Solid<'_>, place: &Place) -> PlainMaterial {
    let plain = scene.materials[place.primitive];
    if !matches!(scene.appearances.get(place.primitive), Some(Some(_))) {
        return plain;
    }
    let candidates = solid.near(place.position, DISTANCE * solid.frame.scale).filter_map(|index| {
        let triangle = &scene.triangles[index];
        let facing = triangle.area_vector().normalize().dot(place.normal).abs() > 0.5;
        (triangle.primitive == place.primitive && facing).then(|| {
            let position = nearest_point(&triangle.corners, place.position);
            (position.distance(place.position), triangle, position)
        })
    });
    let nearest = candidates.min_by(|a, b| a.0.total_cmp(&b.0));
    nearest.map_or(plain, |(_, triangle, position)| scene.material_at(triangle, position))
}

/// The point of a triangle that two uniform numbers stand for, uniform over the area.
pub(super) fn point_of(&[a, b, c]: &[DVec3; 3], u: f64, v: f64) -> DVec3 {
    let root = u.sqrt();
    a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v)
}

/// The point of a triangle that is nearest to another point: in its inside, or on one of its edges.
fn nearest_point(corners: &[DVec3; 3], point: DVec3) -> DVec3 {
    let [a, b, c] = *corners;
    let normal = (b - a).cross(c - a).normalize();
    let foot = point - normal * (point - a).dot(normal);
    let edges = [(a, b), (b, c), (c, a)];
    if edges.iter().all(|&(from, to)| (to - from).cross(foot - from).dot(normal) >= 0.0) {
        return foot;
    }
    let on_edges = edges.map(|(from, to)| {
        let edge = to - from;
        from + edge * ((point - from).dot(edge) / edge.length_squared()).clamp(0.0, 1.0)
    });
    on_edges.into_iter().fold(on_edges[0], |nearest, other| {
        if other.distance_squared(point) < nearest.distance_squared(point) { other } else { nearest }
    })
}
