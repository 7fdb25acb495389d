//! Finds the triangle under a point, by a uniform grid.

use glam::{DVec3, UVec3};
use kernel::geometry::Bounds;

/// Distance from which a point looks for its triangle, as a share of the scene's extent.
const DISTANCE: f64 = 1e-4;

/// How far outside a triangle, in barycentric coordinates, still counts as inside: a shared edge belongs to both sides.
const EDGE: f64 = 1e-6;

/// Part of that distance by which surfaces lie at one place: the two sides of a sheet whose vertices were rounded.
const SAME_PLACE: f64 = 0.2;

/// Most cells along an axis.
const MOST_CELLS: f64 = 64.0;

/// Triangles by the grid cells that they touch.
pub(super) struct TriangleGrid<'a> {
    triangles: &'a [[DVec3; 3]],
    /// How far above its surface a point starts to look.
    distance: f64,
    low: DVec3,
    cell: DVec3,
    counts: UVec3,
    cells: Vec<Vec<u32>>,
}

/// Where the line through a point meets a triangle.
struct Hit {
    triangle: usize,
    /// Depth under the starting point above the surface.
    depth: f64,
    /// The triangle shows its front to the point's normal.
    front: bool,
}

impl<'a> TriangleGrid<'a> {
    /// Sorts the triangles of a scene of this extent.
    pub(super) fn new(triangles: &'a [[DVec3; 3]], extent: f64) -> Self {
        let distance = extent * DISTANCE;
        // A point looks no further than this.
        let margin = DVec3::splat(4.0 * distance);
        let Bounds { low, high } = Bounds::around(triangles.as_flattened()).padded(margin);
        let along = (2.0 * (triangles.len() as f64).cbrt()).ceil().clamp(1.0, MOST_CELLS);
        let counts = UVec3::splat(along as u32);
        let cells = vec![Vec::new(); counts.element_product() as usize];
        let mut grid = Self { triangles, distance, low, cell: (high - low) / along, counts, cells };
        for (index, triangle) in triangles.iter().enumerate() {
            let around = Bounds::around(triangle).padded(margin);
            let first = grid.cell_of(around.low).min(counts - 1);
            let last = grid.cell_of(around.high).min(counts - 1);
            for z in first.z..=last.z {
                for y in first.y..=last.y {
                    for x in first.x..=last.x {
                        let cell = grid.index(UVec3::new(x, y, z));
                        grid.cells[cell].push(index as u32);
                    }
                }
            }
        }
        grid
    }

    /// The triangle at a point and the point's barycentric coordinates in it: the one nearest along the normal, since another surface
    /// may come close, as a roof does to the wall that it rests on; of several at one place the nearest whose front faces up.
    pub(super) fn locate(&self, point: DVec3, normal: DVec3) -> Option<(usize, DVec3)> {
        let cell = self.cell_of(point);
        if cell.cmpge(self.counts).any() {
            return None;
        }
        let hits: Vec<Hit> = self.cells[self.index(cell)]
            .iter()
            .filter_map(|&triangle| self.meet(triangle as usize, point + normal * self.distance, normal))
            .collect();
        let off = |hit: &Hit| (hit.depth - self.distance).abs();
        let nearest = hits.iter().map(off).reduce(f64::min)?;
        let at_one_place = hits.iter().filter(|hit| off(hit) - nearest < SAME_PLACE * self.distance);
        let hit = at_one_place.min_by(|a, b| b.front.cmp(&a.front).then(off(a).total_cmp(&off(b))))?;
        Some((hit.triangle, barycentric(&self.triangles[hit.triangle], point)))
    }

    fn meet(&self, triangle: usize, start: DVec3, normal: DVec3) -> Option<Hit> {
        let corners = &self.triangles[triangle];
        let [a, b, c] = *corners;
        let face = (b - a).cross(c - a);
        let slope = face.dot(normal);
        let depth = (start - a).dot(face) / slope;
        // NaN, of triangles without area or edge-on, is within no range. Nearly without area, not all weights are numbers.
        let near = (0.0..4.0 * self.distance).contains(&depth);
        let is_inside = |weights: DVec3| weights.is_finite() && weights.min_element() >= -EDGE;
        let is_met = near && is_inside(barycentric(corners, start - normal * depth));
        is_met.then_some(Hit { triangle, depth, front: slope > 0.0 })
    }

    /// The cell that holds the point; where it lies beside the grid, a cell that does not exist, or the nearest.
    fn cell_of(&self, point: DVec3) -> UVec3 {
        ((point - self.low) / self.cell).max(DVec3::ZERO).as_uvec3()
    }

    fn index(&self, cell: UVec3) -> usize {
        ((cell.z * self.counts.y + cell.y) * self.counts.x + cell.x) as usize
    }
}

/// Barycentric coordinates of the point's projection onto the triangle's plane.
fn barycentric(&[a, b, c]: &[DVec3; 3], point: DVec3) -> DVec3 {
    let (e1, e2, p) = (b - a, c - a, point - a);
    let (d11, d12, d22) = (e1.dot(e1), e1.dot(e2), e2.dot(e2));
    let (p1, p2) = (p.dot(e1), p.dot(e2));
    let determinant = d11 * d22 - d12 * d12;
    let (u, v) = ((d22 * p1 - d12 * p2) / determinant, (d11 * p2 - d12 * p1) / determinant);
    DVec3::new(1.0 - u - v, u, v)
}
