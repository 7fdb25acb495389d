//! An automatic view of a scene.
//!
//! Views from outside that hold the whole scene, and views from within it, are tried with few rays each. Best is the one that shows
//! most: many primitives, each of them large, and light on them. A room whose walls have no backs is looked into
//! from outside, through the walls; one with walls of two sides from a corner of its inside.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_4, PI};

use glam::DVec3;
use kernel::geometry::Bounds;
use kernel::picture::tracer::Picture;
use kernel::picture::{Camera, PictureScene, Projection};

use super::cameras::Basis;

/// Rays from top to bottom of a candidate view.
const LINES: u32 = 24;

/// Angle of view from bottom to top, from outside and from within.
const ANGLES: [f64; 2] = [40.0 * PI / 180.0, 65.0 * PI / 180.0];

/// Elevations of the views from outside, in radians.
const ELEVATIONS: [f64; 3] = [0.0, 0.35, 0.7];

/// Space around the scene, relative.
const MARGIN: f64 = 1.04;

/// Place of a view from within: part of the way from the box's centre to its sides, and of its height.
const INSIDE: [f64; 2] = [0.84, 0.58];

/// Chooses the view that shows most of a scene, for this aspect (width over height).
#[must_use]
pub fn choose_view(scene: &PictureScene, aspect: f64) -> Camera {
    let corners = scene.parts.iter().flat_map(|part| &part.positions).copied().map(DVec3::from_array);
    let bounds = Bounds::around(corners);
    let picture = Picture::new(scene.clone());
    let mut best: Option<(f64, Camera)> = None;
    for camera in from_outside(bounds, aspect).chain(from_within(bounds, aspect)) {
        let score = score(&picture, &camera, aspect);
        if best.is_none_or(|(most, _)| score > most) {
            best = Some((score, camera));
        }
    }
    match best {
        Some((_, camera)) => camera,
        // The axes are never parallel, so there is always one.
        None => Camera {
            eye: DVec3::Z * 4096.0,
            right: DVec3::X,
            up: DVec3::Y,
            forward: DVec3::NEG_Z,
            projection: Projection::Perspective { half: [aspect, 1.0] },
            near: 0.0,
        },
    }
}

/// Half the width and height at distance 1.
fn half(angle: f64, aspect: f64) -> [f64; 2] {
    let height = (angle / 2.0).tan();
    // What is as high as it is wide fits into a tall picture, too.
    if aspect < 1.0 { [height, height / aspect] } else { [height * aspect, height] }
}

/// Eight directions, at some elevations, just far enough away to see all.
fn from_outside(bounds: Bounds, aspect: f64) -> impl Iterator<Item = Camera> {
    let centre = bounds.centre();
    let half = half(ANGLES[0], aspect);
    let corners = bounds.corners().map(|corner| corner - centre);
    let views = ELEVATIONS.into_iter().flat_map(|elevation| (0..8).map(move |turn| (turn, elevation)));
    views.filter_map(move |(turn, elevation): (u32, f64)| {
        let angle = f64::from(turn) * FRAC_PI_4;
        let outward =
            DVec3::new(angle.sin() * elevation.cos(), elevation.sin(), angle.cos() * elevation.cos());
        let basis = Basis::new(-outward, DVec3::Y)?;
        let axes = basis.camera(DVec3::ZERO, Projection::Perspective { half }, 0.0);
        let distance = corners.map(|corner| {
            let across = [corner.dot(axes.right).abs() / half[0], corner.dot(axes.up).abs() / half[1]];
            across[0].max(across[1]) * MARGIN + corner.dot(outward)
        });
        let eye = centre + outward * distance.into_iter().fold(0.0, f64::max);
        Some(Camera { eye, ..axes })
    })
}

/// From the corners and the middles of the sides to the middle, a little downward.
fn from_within(bounds: Bounds, aspect: f64) -> impl Iterator<Item = Camera> {
    let (low, centre, size) = (bounds.low, bounds.centre(), bounds.extent());
    let half = half(ANGLES[1], aspect);
    (0..8).filter_map(move |turn: u32| {
        let angle = f64::from(turn) * FRAC_PI_4;
        let step = |value: f64| if value.abs() < 0.1 { 0.0 } else { value.signum() };
        let aside = DVec3::new(step(angle.sin()), 0.0, step(angle.cos())) * 0.5 * INSIDE[0];
        let eye = DVec3::new(centre.x, low.y + size.y * INSIDE[1], centre.z) + aside * size;
        let target = DVec3::new(centre.x, low.y + size.y * 0.42, centre.z) - aside * size * 0.5;
        let basis = Basis::new(target - eye, DVec3::Y)?;
        Some(basis.camera(eye, Projection::Perspective { half }, 0.0))
    })
}

/// How much a view shows.
fn score(picture: &Picture, camera: &Camera, aspect: f64) -> f64 {
    let columns = ((f64::from(LINES) * aspect) as u32).clamp(1, 8 * LINES);
    let total = f64::from(LINES * columns);
    let mut seen: BTreeMap<usize, u32> = BTreeMap::new();
    let mut lit = 0_u32;
    for y in 0..LINES {
        for x in 0..columns {
            let place = [(x, columns), (y, LINES)].map(|(at, of)| (f64::from(at) + 0.5) / f64::from(of));
            let ray = camera.ray(place[0], place[1]);
            if let Some((part, _)) = picture.first_surface(&ray) {
                *seen.entry(part).or_default() += 1;
                let (radiance, _) = picture.radiance(&ray, DVec3::ZERO);
                lit += u32::from(radiance.max_element() > 0.0);
            }
        }
    }
    // The square root counts a large and a small surface as more than one large one.
    let shown: f64 = seen.values().map(|count| (f64::from(*count) / total).sqrt()).sum();
    let seen = seen.values().sum::<u32>().max(1);
    shown * (0.05 + f64::from(lit) / f64::from(seen))
}
