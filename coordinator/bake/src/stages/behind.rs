//! Light that falls on the backs of one-sided surfaces: the sign of triangles that are wound the wrong way.
//!
//! A one-sided surface neither reflects nor shows what falls on its back: that light is lost. Where a modeller meant it so, there is
//! none to speak of: the backs of a closed box lie in its dark inside. A flipped wall or a box turned inside out has its back in the
//! light. Some points on the back of each surface are therefore taken as receivers, and rows tell what they get.

use std::collections::{HashMap, HashSet};

use glam::DVec3;
use kernel::geometry::PlaneId;
use kernel::replica::{Receiver, Receivers};

use super::light::LightSource;
use super::{Bake, BakeError, light};
use scene::{Facet, Scene, Side, SourceTriangle};

/// Key of the first point as a receiver: above all vertices and check points, so that its rays are its own.
const FIRST_KEY: u64 = 1 << 33;

/// Points on the back of a surface.
const POINTS: usize = 16;

/// Points are one for this many vertices of the mesh at most, but at least one for each surface: what is asked for in addition to the
/// solution costs little beside it.
const VERTICES_PER_POINT: usize = 16;

/// Part of the emitted flux that must escape before backs are looked at: without it no back gets light.
const LEAST_ESCAPED: f64 = 1e-6;

/// Part of the emitted flux on the back of a surface that is worth a warning, unless the surface is closed: what glows inside of a
/// solid, such as the part of a bright floor that a box stands on, is no fault of the solid.
const MUCH: f64 = 0.01;

/// A surface whose front gets less than this part of what its back gets is turned the wrong way, however small it is.
const DARK_FRONT: f64 = 0.01;

/// A point on the back of a surface.
struct BackPoint {
    surface: usize,
    receiver: Receiver,
}

impl Bake<'_, '_> {
    /// Warnings of surfaces that lose light on their backs. Needs the solution.
    #[tracing::instrument(skip_all)]
    pub(super) fn look_behind(&mut self) -> Result<Vec<String>, BakeError> {
        let balance = self.balance();
        let emitted: f64 = balance.emitted.iter().sum();
        if balance.escaped.iter().sum::<f64>() <= LEAST_ESCAPED * emitted {
            return Ok(vec![]);
        }
        let points = back_points(self.scene, self.mesh.vertices.len() / VERTICES_PER_POINT);
        if points.is_empty() {
            return Ok(vec![]);
        }
        let irradiance = self.irradiance_at(&points)?;
        let fronts = self.mean_irradiance();
        let mut backs: Vec<(f64, DVec3)> = vec![(0.0, DVec3::ZERO); self.scene.surfaces.len()];
        for (point, irradiance) in points.iter().zip(irradiance) {
            backs[point.surface].0 += 1.0;
            backs[point.surface].1 += irradiance;
        }
        let square_unit = self.scene.frame.scale * self.scene.frame.scale;
        let mut warnings = vec![];
        for (index, (count, sum)) in backs.into_iter().enumerate().filter(|(_, (count, _))| *count > 0.0) {
            let back = (sum / count).element_sum();
            let (area, front) = fronts[index];
            let lost = back * area * square_unit * self.scene.surfaces[index].opacity / emitted;
            let flipped = back > 0.0 && front.element_sum() < DARK_FRONT * back;
            if flipped || lost >= MUCH && !is_closed(&self.scene.surfaces[index].facets) {
                let cure = if flipped {
                    "flip its triangles"
                } else {
                    "flip its triangles or make its material double-sided"
                };
                warnings.push(format!(
                    "{}: {:.1} % of all light falls on its back and is lost, its front gets {}: {cure}",
                    self.scene.surfaces[index].name,
                    100.0 * lost,
                    if flipped { "next to none" } else { "some too" },
                ));
            }
        }
        Ok(warnings)
    }

    fn irradiance_at(&mut self, points: &[BackPoint]) -> Result<Vec<DVec3>, BakeError> {
        let receivers = points.iter().map(|point| point.receiver).collect();
        let receivers = Receivers { first_key: FIRST_KEY, receivers };
        let set = self.office.publish_receivers(&receivers);
        // The sun on a roof, and the sky under a floor, are no light that the scene has and loses.
        let inside: Vec<LightSource> =
            self.sources.iter().filter(|source| !source.is_outside).cloned().collect();
        let direct = light::irradiance(&inside, set, self.office, |_, _, _| ())?;
        let mut gathered = self.channels.gathering(set.count());
        let radiosity = &self.radiosity;
        self.rows
            .each_over(self.office, set, &receivers, |share, row| gathered.add(row, radiosity[share]))?;
        self.office.release_receivers(set);
        Ok(direct.iter().zip(gathered.into_irradiance()).map(|(direct, light)| *direct + light).collect())
    }

    /// Area, in the frame, and mean irradiance of each surface.
    fn mean_irradiance(&self) -> Vec<(f64, DVec3)> {
        let mut sums = vec![(0.0, DVec3::ZERO); self.scene.surfaces.len()];
        for (_, patch) in self.mesh.leaves() {
            let corners = patch.corners.iter().map(|corner| self.irradiance[corner.index()]);
            let mean = corners.sum::<DVec3>() / patch.corners.len() as f64;
            let (area, flux) = &mut sums[patch.surface as usize];
            *area += patch.area;
            *flux += mean * patch.area;
        }
        sums.into_iter().map(|(area, flux)| (area, if area > 0.0 { flux / area } else { flux })).collect()
    }
}

/// Points on the backs of all one-sided surfaces, at even distances by area, but for those that another surface in the same plane
/// covers: two sheets back to back have no back.
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

/// So many points on some facets, at even distances by area: centres of gravity of their triangles.
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
