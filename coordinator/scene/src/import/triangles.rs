//! A primitive's triangles in the frame: welded, and rid of those without area and of duplicates.

use std::collections::{HashMap, HashSet};

use foldhash::fast::RandomState;
use glam::{DAffine3, DMat3, DVec3};

use super::primitives::Geometry;
use crate::frame::Frame;
use document::nodes::normal_matrix;

/// Height over longest edge below which a triangle has no area to speak of: its normal would be noise even in f64.
const LEAST_HEIGHT: f64 = 1e-10;

/// Cosine of the deviation (one degree) from which a normal of the file counts as smooth shading.
const SMOOTH_COSINE: f64 = 0.999_847_695;

/// Cosine (31 degrees) down to which a normal of the file tells how a surface bends: those of a prism with six sides still do. Beyond,
/// edges are smoothed that nobody takes for round, as a box's are, and the normal looks at what its facet does not see.
const LEAST_NORMAL_COSINE: f64 = 0.857_167_3;

/// Cosine down to which a normal of the file can be meant: beyond, it points along the surface or away from it.
const LEAST_MEANT_COSINE: f64 = 0.1;

/// Half a unit in the last place of an f32, relative: how far the file's coordinates may be off by rounding.
const F32_ROUNDING: f64 = 1.0 / (1u64 << 24) as f64;

/// The rounding of frame coordinates themselves, which reach 1024.
const FRAME_ROUNDING: f64 = 1024.0 * f64::EPSILON;

/// A triangle in the frame.
pub(super) struct Triangle {
    /// Indices into the primitive's vertex attributes.
    pub(super) vertices: [u32; 3],
    /// Indices into [`TriangleMesh::points`]: equal positions have equal indices.
    pub(super) points: [u32; 3],
    /// Along the normal, as long as the area is large.
    pub(super) area_vector: DVec3,
    /// The file's unit normal at each corner where that deviates from the triangle's.
    pub(super) smooth_normals: [Option<DVec3>; 3],
}

impl Triangle {
    /// Height over the longest edge.
    pub(super) fn height(&self, points: &[DVec3]) -> f64 {
        let [a, b, c] = self.points.map(|point| points[point as usize]);
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a)).sqrt();
        2.0 * self.area_vector.length() / longest
    }
}

/// The triangles of one primitive of one node, counter-clockwise seen from the front.
pub(super) struct TriangleMesh {
    /// Positions in the frame, all different.
    pub(super) points: Vec<DVec3>,
    /// Triangles with an area, all different.
    pub(super) triangles: Vec<Triangle>,
    /// How far the rounding of the file's coordinates may have moved a point, frame units.
    pub(super) rounding: f64,
    /// Whether normals of the file lean further from their triangles than light follows, and may yet be meant.
    pub(super) leans_far: bool,
    /// Number of triangles dropped because they have no area.
    pub(super) degenerate: usize,
    /// Number of triangles dropped because another has the same positions and winding.
    pub(super) duplicates: usize,
}

impl TriangleMesh {
    /// Places a primitive. A transform that mirrors has the winding turned round, so that the front stays the front.
    ///
    /// `welded` are the vertices' world positions where these were moved, and how far at most.
    pub(super) fn new(
        geometry: &Geometry,
        world: &DAffine3,
        frame: &Frame,
        welded: Option<(&[DVec3], f64)>,
    ) -> Self {
        let mirrored = world.matrix3.determinant() < 0.0;
        // Facets are flat within four times the rounding.
        let moved = welded.map_or(0.0, |(_, distance)| distance / 4.0);
        let mut mesh = Self {
            points: Vec::new(),
            triangles: Vec::with_capacity(geometry.triangles.len()),
            rounding: (rounding(geometry, &world.matrix3) + moved) / frame.scale + FRAME_ROUNDING,
            leans_far: false,
            degenerate: 0,
            duplicates: 0,
        };
        let normals = transformed_normals(geometry, world.matrix3);
        let welded = mesh.weld(geometry, world, frame, welded.map(|(positions, _)| positions));
        let mut seen = HashSet::with_capacity_and_hasher(geometry.triangles.len(), RandomState::default());
        for &[a, b, c] in &geometry.triangles {
            let vertices = if mirrored { [a, c, b] } else { [a, b, c] };
            let points = vertices.map(|vertex| welded[vertex as usize]);
            let Some(area_vector) = area_vector(points.map(|point| mesh.points[point as usize])) else {
                mesh.degenerate += 1;
                continue;
            };
            if !seen.insert(smallest_first(points)) {
                mesh.duplicates += 1;
                continue;
            }
            let normal = area_vector.normalize();
            let file_normals = vertices.map(|vertex| normals.get(vertex as usize).copied());
            mesh.leans_far |= file_normals.into_iter().flatten().any(|own| leans_far(normal, own));
            let smooth_normals = file_normals.map(|own| smooth_normal(normal, own?));
            mesh.triangles.push(Triangle { vertices, points, area_vector, smooth_normals });
        }
        mesh
    }

    /// Gives equal positions one point, by their bits: files repeat a position for every normal and texture coordinate.
    fn weld(
        &mut self,
        geometry: &Geometry,
        world: &DAffine3,
        frame: &Frame,
        moved: Option<&[DVec3]>,
    ) -> Vec<u32> {
        let mut known = HashMap::with_capacity_and_hasher(geometry.positions.len(), RandomState::default());
        let mut welded = Vec::with_capacity(geometry.positions.len());
        for (vertex, &position) in geometry.positions.iter().enumerate() {
            let position = moved.map_or_else(|| to_world(world, position), |moved| moved[vertex]);
            // Adding zero makes a negative zero positive.
            let point = frame.to_frame(position) + DVec3::ZERO;
            let index = *known.entry(point.to_array().map(f64::to_bits)).or_insert_with(|| {
                self.points.push(point);
                self.points.len() as u32 - 1
            });
            welded.push(index);
        }
        welded
    }
}

/// World position of a vertex.
pub(super) fn to_world(world: &DAffine3, position: [f32; 3]) -> DVec3 {
    world.transform_point3(DVec3::from_array(position.map(f64::from)))
}

fn rounding(geometry: &Geometry, matrix: &DMat3) -> f64 {
    let largest = geometry
        .positions
        .iter()
        .fold(DVec3::ZERO, |largest, position| largest.max(DVec3::from_array(position.map(f64::from)).abs()));
    let absolute = DMat3::from_cols(matrix.x_axis.abs(), matrix.y_axis.abs(), matrix.z_axis.abs());
    rounding_of((absolute * largest).max_element())
}

/// How far a coordinate of this magnitude may be off because it was rounded to f32.
pub(super) fn rounding_of(magnitude: f64) -> f64 {
    F32_ROUNDING * magnitude
}

/// Unit normals in the frame; NaN where the file's are zero or NaN. Empty if there are none.
fn transformed_normals(geometry: &Geometry, matrix: DMat3) -> Vec<DVec3> {
    let matrix = normal_matrix(matrix);
    let transform = |normal: &[f32; 3]| (matrix * DVec3::from_array(normal.map(f64::from))).normalize();
    geometry.normals.iter().flatten().map(transform).collect()
}

/// The file's normal where it is meant to differ from the triangle's. NaN fails both comparisons.
fn smooth_normal(normal: DVec3, file_normal: DVec3) -> Option<DVec3> {
    let cosine = normal.dot(file_normal);
    (cosine > LEAST_NORMAL_COSINE && cosine < SMOOTH_COSINE).then_some(file_normal)
}

/// Whether the file's normal leans too far for light, though not along the triangle.
fn leans_far(normal: DVec3, file_normal: DVec3) -> bool {
    let cosine = normal.dot(file_normal);
    cosine > LEAST_MEANT_COSINE && cosine <= LEAST_NORMAL_COSINE
}

/// Area vector from the two shorter edges, whose cross product suffers least from rounding; `None` without an area.
fn area_vector(corners: [DVec3; 3]) -> Option<DVec3> {
    let edge = |i: usize| corners[(i + 1) % 3] - corners[i];
    let lengths = [0, 1, 2].map(|i| edge(i).length_squared());
    let longest = (0..3).fold(0, |longest, i| if lengths[i] > lengths[longest] { i } else { longest });
    let twice_area = edge((longest + 1) % 3).cross(edge((longest + 2) % 3));
    let has_area = twice_area.length() > LEAST_HEIGHT * lengths[longest];
    has_area.then_some(twice_area * 0.5)
}

/// The same cycle for all three ways to begin a triangle.
fn smallest_first([a, b, c]: [u32; 3]) -> [u32; 3] {
    if a < b && a < c {
        [a, b, c]
    } else if b < c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}
