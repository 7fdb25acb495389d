//! Insides of closed bodies: the backs of double-sided facets that no light can reach.
//!
//! A body is closed where each edge of its triangles is run along as often one way as the other. The winding number, how often the
//! body goes around a point, is then the same all along any path that does not cross it: where it is not 0, light from outside
//! cannot come. Furniture modelled as solids, with materials that are double sided by habit, is half of such backs.

use foldhash::{HashMap, HashMapExt};
use glam::DVec3;
use kernel::disjoint_sets::DisjointSets;
use kernel::geometry::Bounds;
use kernel::hierarchy::{Hierarchy, PaddedBox};
use rayon::prelude::*;

use crate::facet::Facet;
use crate::light::Light;
use crate::model::{Side, Surface};

/// Directions in which a facet's back looks for the body around it, beside its own; they have to agree, because a ray may graze an
/// edge. Lengths and directions are arbitrary, but for no symmetry of things that people build.
const ASIDE: [DVec3; 3] =
    [DVec3::new(0.31, 0.17, -0.23), DVec3::new(-0.19, 0.29, 0.13), DVec3::new(0.11, -0.27, 0.37)];

/// What boxes are padded by, frame units: more than what single precision loses.
const ROUNDING: f64 = 1e-3;

/// A triangle of a front.
struct Triangle {
    surface: u32,
    facet: u32,
    corners: [DVec3; 3],
}

impl Triangle {
    fn place(&self) -> (u32, u32) {
        (self.surface, self.facet)
    }

    fn normal(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }

    /// Whether a ray from outside of it goes through it.
    fn is_crossed(&self, origin: DVec3, direction: DVec3) -> bool {
        let [a, b, c] = self.corners.map(|corner| corner - origin);
        // Which way round the ray passes an edge: of two triangles that share it, one says this, the other that.
        let passes = |from: DVec3, to: DVec3| {
            if from.to_array() <= to.to_array() {
                direction.dot(from.cross(to)) >= 0.0
            } else {
                direction.dot(to.cross(from)) < 0.0
            }
        };
        let ways = [passes(a, b), passes(b, c), passes(c, a)];
        let is_between = ways == [true; 3] || ways == [false; 3];
        let normal = self.normal();
        is_between && (normal.dot(a) > 0.0) == (normal.dot(direction) > 0.0)
    }
}

/// Marks the facets whose lit side is the inside of a closed body without light.
pub(super) fn mark(surfaces: &mut [Surface], lights: &[Light]) {
    // The back of a primitive follows its front, facet by facet.
    let back = |front: usize| surfaces.get(front + 1).is_some_and(|next| next.side == Side::Back);
    let has_back: Vec<bool> = (0..surfaces.len()).map(back).collect();
    if !has_back.contains(&true) {
        return;
    }
    let shining = Shining::new(surfaces, lights);
    let bodies = closed_bodies(triangles(surfaces));
    let sealed: Vec<(u32, u32)> = bodies
        .par_iter()
        .filter(|body| !shining.is_near(body))
        .flat_map(|body| insides(body, &has_back))
        .collect();
    for (front, facet) in sealed {
        surfaces[front as usize + 1].facets[facet as usize].is_sealed = true;
    }
}

/// Triangles of all opaque fronts.
fn triangles(surfaces: &[Surface]) -> Vec<Triangle> {
    let fronts = surfaces
        .iter()
        .enumerate()
        .filter(|(_, surface)| surface.side == Side::Front && surface.opacity >= 1.0);
    let facets = fronts.flat_map(|(surface, own)| {
        own.facets.iter().enumerate().map(move |(facet, own)| (surface as u32, facet as u32, own))
    });
    let of = facets.flat_map(|(surface, facet, own)| {
        own.triangles.iter().map(move |triangle| Triangle { surface, facet, corners: triangle.positions })
    });
    of.collect()
}

/// The triangles of each closed body, in the order of their first ones.
fn closed_bodies(triangles: Vec<Triangle>) -> Vec<Vec<Triangle>> {
    let mut points: HashMap<[u64; 3], u32> = HashMap::with_capacity(triangles.len());
    let mut edges: Vec<([u32; 2], u32, i32)> = Vec::with_capacity(3 * triangles.len());
    for (index, triangle) in (0..).zip(&triangles) {
        let corners = triangle.corners.map(|corner| {
            let next = points.len() as u32;
            *points.entry(corner.to_array().map(f64::to_bits)).or_insert(next)
        });
        for i in 0..3 {
            let (from, to) = (corners[i], corners[(i + 1) % 3]);
            edges.push(if from < to { ([from, to], index, 1) } else { ([to, from], index, -1) });
        }
    }
    edges.par_sort_unstable();
    let mut joined = DisjointSets::new(triangles.len());
    let mut is_open = vec![false; triangles.len()];
    for shared in edges.chunk_by(|(a, ..), (b, ..)| a == b) {
        let (_, first, _) = shared[0];
        shared.iter().for_each(|(_, other, _)| joined.join(first as usize, *other as usize));
        is_open[first as usize] |= shared.iter().map(|(.., way)| way).sum::<i32>() != 0;
    }
    let bodies: Vec<usize> = (0..triangles.len()).map(|index| joined.representative(index)).collect();
    for (index, body) in bodies.iter().enumerate() {
        is_open[*body] |= is_open[index];
    }
    let mut numbers = HashMap::new();
    let mut closed: Vec<Vec<Triangle>> = vec![];
    for (triangle, body) in triangles.into_iter().zip(bodies).filter(|(_, body)| !is_open[*body]) {
        let number = *numbers.entry(body).or_insert_with(|| {
            closed.push(vec![]);
            closed.len() - 1
        });
        closed[number].push(triangle);
    }
    closed
}

/// Surfaces and lamps that shine.
struct Shining(Hierarchy<Bounds>);

impl Shining {
    fn new(surfaces: &[Surface], lights: &[Light]) -> Self {
        // Backs lie where their fronts do.
        let emits = surfaces
            .par_iter()
            .filter(|surface| surface.exitance != DVec3::ZERO && surface.side == Side::Front);
        // Of a surface whose emission is a picture, most facets are often black.
        let shining = |surface: &Surface, (index, facet): (usize, &Facet)| -> Option<Bounds> {
            let corners: Vec<DVec3> = facet.positions().collect();
            let exitance = surface.mean_exitance(index as u32, &corners);
            (exitance != DVec3::ZERO).then(|| Bounds::around(corners))
        };
        let facets: Vec<Bounds> = emits
            .flat_map(|surface| {
                surface.facets.par_iter().enumerate().filter_map(move |facet| shining(surface, facet))
            })
            .collect();
        let near = lights.iter().map(|light| light.kind.extremes()).filter(|extremes| !extremes.is_empty());
        let boxes = facets.into_iter().chain(near.map(Bounds::around)).collect();
        Self(Hierarchy::new(boxes, |bounds: &Bounds| PaddedBox::around([bounds.low, bounds.high], ROUNDING)))
    }

    /// Whether something shines in the box around a body, or is a part of it.
    fn is_near(&self, body: &[Triangle]) -> bool {
        let corners = body.iter().flat_map(|triangle| triangle.corners);
        !self.0.touching(&PaddedBox::around(corners, ROUNDING)).is_empty()
    }
}

/// Facets of a body that it goes around the backs of, by surface and facet; of surfaces with backs.
fn insides(body: &[Triangle], has_back: &[bool]) -> Vec<(u32, u32)> {
    let mut of_facets: Vec<&Triangle> =
        body.iter().filter(|triangle| has_back[triangle.surface as usize]).collect();
    of_facets.dedup_by_key(|triangle| triangle.place());
    if of_facets.is_empty() {
        return vec![];
    }
    let body = Hierarchy::new(body.iter().collect(), |triangle: &&Triangle| {
        PaddedBox::around(triangle.corners, ROUNDING)
    });
    let inside = of_facets.into_par_iter().filter(|triangle| is_inside(triangle, &body));
    inside.map(|triangle| triangle.place()).collect()
}

/// Whether a body goes around what lies right behind one of its triangles.
fn is_inside(triangle: &Triangle, body: &Hierarchy<&Triangle>) -> bool {
    let back = -triangle.normal().normalize_or_zero();
    let [first, others @ ..] = ASIDE.map(|aside| winding(triangle, body, back + aside));
    first != 0 && others.iter().all(|other| *other == first)
}

/// How often a body goes around a point right behind one of its triangles: how often a ray from there leaves the body, but for how
/// often it enters.
fn winding(own: &Triangle, body: &Hierarchy<&Triangle>, direction: DVec3) -> i32 {
    let origin = own.corners.iter().sum::<DVec3>() / 3.0;
    let mut winding = 0;
    body.along_ray(origin, direction, |_, triangle| {
        if triangle.place() != own.place() && triangle.is_crossed(origin, direction) {
            winding += if triangle.normal().dot(direction) > 0.0 { 1 } else { -1 };
        }
        f32::INFINITY
    });
    winding
}
