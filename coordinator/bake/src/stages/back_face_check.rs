//! The back-face check: warns of light that falls on the backs of one-sided surfaces, the sign of flipped triangles.
//!
//! A one-sided surface neither reflects nor shows light on its back: it is lost. The backs of a closed box lie in its dark inside,
//! but a flipped wall or a box turned inside out has its back in the light. The irradiance at some points on the back of each
//! surface tells.

use std::collections::{HashMap, HashSet};

use glam::DVec3;
use kernel::geometry::PlaneId;
use kernel::replica::{Receiver, Receivers};

use super::irradiance::{Lights, Place, irradiance_at};
use super::light_source::LightSource;
use super::solved::Solved;
use crate::context::Context;
use crate::error::Result;
use scene::{Facet, Scene, Side, SourceTriangle};

/// Key of the first point as a receiver: above all vertices and sample points, so that its rays are its own.
const FIRST_KEY: u64 = 1 << 33;

/// Points on the back of a surface.
const POINTS: usize = 16;

/// At most one point for this many vertices of the mesh, but at least one per surface: the check costs little beside the solution.
const VERTICES_PER_POINT: usize = 16;

/// Most points, unless there are more surfaces.
const MOST_POINTS: usize = 4096;

/// Part of the emitted flux that must escape before backs are checked: without it no back gets light.
const LEAST_ESCAPED: f64 = 1e-6;

/// Part of the emitted flux on the back of a surface that is worth a warning, unless the surface is closed: light inside a
/// solid, such as from the part of a bright floor that a box stands on, is no fault of the solid.
const MUCH: f64 = 0.01;

/// A surface whose front gets less than this part of the light on its back is flipped, however small it is.
const DARK_FRONT: f64 = 0.01;

/// A point on the back of a surface.
struct BackPoint {
    surface: usize,
    receiver: Receiver,
}

impl Solved {
    /// Warnings of surfaces that lose light on their backs.
    #[tracing::instrument(skip_all)]
    pub fn back_face_check(&mut self, cx: &mut Context) -> Result<Vec<String>> {
        let balance = self.balance(cx);
        let emitted: f64 = balance.emitted.iter().sum();
        if balance.escaped.iter().sum::<f64>() <= LEAST_ESCAPED * emitted {
            return Ok(vec![]);
        }
        let scene = cx.scene;
        let points =
            back_points(scene, (self.mesh.mesh.vertices.len() / VERTICES_PER_POINT).min(MOST_POINTS));
        if points.is_empty() {
            return Ok(vec![]);
        }
        let receivers = points.iter().map(|point| point.receiver).collect();
        let receivers = Receivers { first_key: FIRST_KEY, receivers };
        // The sun on a roof and the sky under a floor are not lost light of the scene.
        let inside: Vec<LightSource> =
            self.sources.all.iter().filter(|source| !source.is_outside).cloned().collect();
        let lights = Lights { sources: &inside, radiosity: self.solution.radiosity() };
        let received = irradiance_at(cx, &self.mesh, &mut self.rows, Place::Once(&receivers), &[lights])?;
        let irradiance = received.light.into_iter().flat_map(|light| light.all);
        let fronts = self.mean_irradiance(scene);
        let mut backs: Vec<(f64, DVec3)> = vec![(0.0, DVec3::ZERO); scene.surfaces.len()];
        for (point, irradiance) in points.iter().zip(irradiance) {
            backs[point.surface].0 += 1.0;
            backs[point.surface].1 += irradiance;
        }
        let square_unit = scene.frame.scale * scene.frame.scale;
        let mut warnings = vec![];
        for (index, (count, sum)) in backs.into_iter().enumerate().filter(|(_, (count, _))| *count > 0.0) {
            let back = (sum / count).element_sum();
            let (area, front) = fronts[index];
            let lost = back * area * square_unit * scene.surfaces[index].opacity / emitted;
            let flipped = back > 0.0 && front.element_sum() < DARK_FRONT * back;
            if flipped || lost >= MUCH && !is_closed(&scene.surfaces[index].facets) {
                let cure = if flipped {
                    "flip its triangles"
                } else {
                    "flip its triangles or make its material double-sided"
                };
                warnings.push(format!(
                    "{}: {:.1} % of all light falls on its back and is lost, its front gets {}: {cure}",
                    scene.surfaces[index].name,
                    100.0 * lost,
                    if flipped { "next to none" } else { "some too" },
                ));
            }
        }
        Ok(warnings)
    }

    /// Area, in the frame, and mean irradiance of each surface.
    fn mean_irradiance(&self, scene: &Scene) -> Vec<(f64, DVec3)> {
        let mut sums = vec![(0.0, DVec3::ZERO); scene.surfaces.len()];
        for (id, patch) in self.mesh.mesh.leaves() {
            let mean = self.mesh.mesh.mean(id, &self.solution.irradiance);
            let (area, flux) = &mut sums[patch.surface as usize];
            *area += patch.area;
            *flux += mean * patch.area;
        }
        sums.into_iter().map(|(area, flux)| (area, if area > 0.0 { flux / area } else { flux })).collect()
    }
}

/// Points on the backs of all one-sided surfaces, evenly by area, except where another surface in the same plane covers them:
/// two sheets back to back have no back.
fn back_points(scene: &Scene, most: usize) -> Vec<BackPoint> {
    let two_sided: HashSet<(usize, usize)> =
        scene.surfaces.iter().filter(|s| s.side == Side::Back).map(|s| (s.node, s.primitive)).collect();
    let mut in_plane: HashMap<PlaneId, Vec<&Facet>> = HashMap::new();
    for facet in scene.surfaces.iter().flat_map(|surface| &surface.facets) {
        in_plane.entry(facet.plane).or_default().push(facet);
    }
    let count = (most / scene.surfaces.len()).clamp(1, POINTS);
    let one_sided =
        scene.surfaces.iter().enumerate().filter(|(_, s)| !two_sided.contains(&(s.node, s.primitive)));
    one_sided
        .flat_map(|(surface, of)| {
            let points = spread(&of.facets, count).into_iter();
            points.map(move |(facet, position)| (surface, facet, position))
        })
        .filter(|(_, facet, position)| {
            !in_plane[&facet.plane]
                .iter()
                .any(|other| other.normal.dot(facet.normal) < 0.0 && covers(other, *position))
        })
        .map(|(surface, facet, position)| BackPoint {
            surface,
            receiver: Receiver { position, normal: -facet.normal, plane: facet.plane },
        })
        .collect()
}

/// Points on some facets, evenly by area: centroids of their triangles.
fn spread(facets: &[Facet], count: usize) -> Vec<(&Facet, DVec3)> {
    let area = |triangle: &SourceTriangle| {
        let [a, b, c] = triangle.positions;
        (b - a).cross(c - a).length()
    };
    let triangles = || facets.iter().flat_map(|facet| facet.triangles.iter().map(move |t| (facet, t)));
    let step = triangles().map(|(_, triangle)| area(triangle)).sum::<f64>() / count as f64;
    let mut points = vec![];
    let (mut passed, mut next) = (0.0, step / 2.0);
    for (facet, triangle) in triangles() {
        passed += area(triangle);
        if passed > next {
            points.push((facet, triangle.positions.iter().sum::<DVec3>() / 3.0));
            next += step * ((passed - next) / step).ceil();
        }
    }
    points
}

/// True when a point of a facet's plane lies in the facet.
fn covers(facet: &Facet, point: DVec3) -> bool {
    let next = facet.corners.iter().cycle().skip(1);
    facet.corners.iter().zip(next).all(|(a, b)| {
        let inward = facet.normal.cross(b.position - a.position);
        inward.dot(point - a.position) >= 0.0
    })
}

/// True when every edge of a surface's triangles has another on its other side.
fn is_closed(facets: &[Facet]) -> bool {
    let mut balance: HashMap<[[u64; 3]; 2], i32> = HashMap::new();
    for triangle in facets.iter().flat_map(|facet| &facet.triangles) {
        let corners = triangle.positions.map(|corner| corner.to_array().map(f64::to_bits));
        for i in 0..3 {
            let (from, to) = (corners[i], corners[(i + 1) % 3]);
            let (edge, way) = if from < to { ([from, to], 1) } else { ([to, from], -1) };
            *balance.entry(edge).or_default() += way;
        }
    }
    balance.values().all(|sum| *sum == 0)
}
