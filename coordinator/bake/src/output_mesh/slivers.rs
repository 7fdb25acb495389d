//! Pieces of slivers that are no more than a line.

use super::grid::ON_EDGE;
use super::working::Working;
use crate::mesh::distance_to_line;

/// Height of a piece that may be a line, relative to its longest edge, at most: corners of very small triangles all lie on their edges.
const FLAT: f64 = 0.3;

/// Drops those of some pieces that have no height: those with two corners at one position, and those whose longest edge no other triangle
/// has.
pub fn drop_slivers(working: &mut Working, mut pieces: Vec<u32>) {
    let all = pieces.len();
    let mut before = usize::MAX;
    // Dropping one may leave a neighbour with such an edge.
    while pieces.len() < before {
        before = pieces.len();
        pieces.retain(|index| {
            let is_line = working.has_two_corners_in_one(*index) || working.is_line_of_its_own(*index);
            if is_line {
                working.remove(*index);
            }
            !is_line
        });
    }
    if pieces.len() < all {
        let Working { points, corners, .. } = working;
        let has_any = |corner: &mut u32| !corners[*corner as usize].around.is_empty();
        points.iter_mut().for_each(|point| point.retain(has_any));
    }
}

impl Working {
    /// Whether two corners of a triangle lie at one position.
    fn has_two_corners_in_one(&self, index: u32) -> bool {
        let [a, b, c] =
            self.triangles[index as usize].corners.map(|corner| self.corners[corner as usize].point);
        a == b || b == c || c == a
    }

    /// Whether a corner of a triangle lies on the opposite edge, which no other triangle has, while others have the two shorter ones.
    fn is_line_of_its_own(&self, index: u32) -> bool {
        let [a, b, c] = self.triangles[index as usize].corners;
        let length = |[a, b, _]: &[u32; 3]| self.at(*a).distance(self.at(*b));
        let sides = [[a, b, c], [b, c, a], [c, a, b]].into_iter();
        let longest = sides.max_by(|one, other| length(one).total_cmp(&length(other)));
        longest.is_some_and(|side @ [from, to, across]| {
            let height = distance_to_line(self.at(across), &[self.at(from), self.at(to)]);
            height <= (ON_EDGE * self.extent).min(FLAT * length(&side))
                && !self.has_another(index, from, to)
                && self.has_another(index, to, across)
                && self.has_another(index, across, from)
        })
    }

    /// Whether a triangle other than this has an edge between the positions of two corners.
    fn has_another(&self, index: u32, from: u32, to: u32) -> bool {
        let place = |corner: u32| self.corners[corner as usize].point as usize;
        let corners = self.points[place(from)].iter();
        let mut around = corners.flat_map(|corner| &self.corners[*corner as usize].around);
        around.any(|other| {
            *other != index && self.triangles[*other as usize].corners.iter().any(|c| place(*c) == place(to))
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::conform::tests::{WIDTH, conforming};
    use super::super::grid::ONE_POINT;
    use super::*;

    /// Edges of one triangle alone, inside which a corner of others lies.
    fn t_junctions(triangles: &[[DVec3; 3]]) -> usize {
        let is_same = |a: DVec3, b: DVec3| a.distance(b) <= 2.0 * ONE_POINT * WIDTH;
        let is_whole = |[a, b, c]: &&[DVec3; 3]| !is_same(*a, *b) && !is_same(*b, *c) && !is_same(*c, *a);
        let edges = || triangles.iter().filter(is_whole).flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
        let has_ends = |[a, b]: [DVec3; 2], [c, d]: [DVec3; 2]| {
            is_same(a, c) && is_same(b, d) || is_same(a, d) && is_same(b, c)
        };
        let is_alone = |edge: &[DVec3; 2]| edges().filter(|other| has_ends(*edge, *other)).count() == 1;
        let has_inside = |edge: &[DVec3; 2]| {
            triangles.iter().flatten().any(|corner| {
                distance_to_line(*corner, edge) <= ON_EDGE * WIDTH
                    && edge.iter().all(|end| !is_same(*end, *corner))
            })
        };
        edges().filter(|edge| is_alone(edge) && has_inside(edge)).count()
    }

    #[test]
    fn pieces_that_are_lines_are_dropped_where_nothing_else_has_their_edge() {
        let [from, to, middle] = [[0.0, 0.0, 0.0], [WIDTH, 0.0, 0.0], [0.6 * WIDTH, 0.0, 0.0]];
        let (above, below) = ([0.5 * WIDTH, 0.5 * WIDTH, 0.0], [0.5 * WIDTH, -0.5 * WIDTH, 0.0]);
        let needle = [from, [0.3 * WIDTH, -1e-4, 0.0], to];
        let triangles = conforming(&[[from, to, above], needle, [from, below, middle], [middle, below, to]]);
        assert_eq!(t_junctions(&triangles), 0, "{triangles:?}");
        // The two below, and the one above, have a corner of the needle and one of each other on an edge.
        let is_high = |[a, b, c]: &&[DVec3; 3]| (*b - *a).cross(*c - *a).length() > 1.0;
        assert_eq!(triangles.iter().filter(is_high).count(), 3 + 3, "{triangles:?}");
    }

    #[test]
    fn very_small_triangles_stay() {
        let at = |x: f64, y: f64| [x * ON_EDGE * WIDTH, y * ON_EDGE * WIDTH, 0.0];
        let [from, to, middle] = [at(0.0, 0.0), at(1.5, 0.0), at(0.75, 0.8)];
        // As wide as the scene, and joined with its shorter edges.
        let [left, right] = [[-WIDTH, WIDTH, 0.0], [WIDTH, WIDTH, 0.0]];
        let triangles = conforming(&[[from, to, middle], [middle, to, right], [from, middle, left]]);
        let is_small = |corners: &&[DVec3; 3]| corners.iter().all(|corner| corner.length() < 1.0);
        assert_eq!(triangles.iter().filter(is_small).count(), 1, "{triangles:?}");
    }
}
