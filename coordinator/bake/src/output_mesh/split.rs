//! Triangles split along their edges.

use glam::DVec3;

/// Height of a triangle that is a line, relative to its longest edge.
const FLAT: f64 = 1e-3;

/// The unit normal at this part of the way from one to another; their own where they are the same.
pub fn normal_between([one, other]: [DVec3; 2], part: f64) -> DVec3 {
    if one == other { one } else { one.lerp(other, part).normalize_or(one) }
}

/// Whether a triangle is no higher than a line: one with a corner on its opposite edge is then no more than that edge. Small triangles
/// have corners near their edges, too, but are as high as they are long.
pub fn is_line([a, b, c]: [DVec3; 3]) -> bool {
    let longest = [a - b, b - c, c - a].map(DVec3::length_squared).into_iter().fold(0.0, f64::max);
    (b - a).cross(c - a).length() <= FLAT * longest
}

/// The triangles of one whose three edges have more corners inside; each edge is given with its ends. A fan to the corner opposite of the
/// first edge that is divided; the next edge belongs to its last triangle.
pub fn fan([ab, bc, ca]: [&[u32]; 3]) -> Vec<[u32; 3]> {
    let [a, _, c] = [ab[0], bc[0], ca[0]];
    let mut parts: Vec<[u32; 3]> = vec![];
    let (first, last) = (ab[1], ab[ab.len() - 2]);
    parts.extend(ab.windows(2).skip(1).take(ab.len().saturating_sub(3)).map(|pair| [pair[0], pair[1], c]));
    if ab.len() == 2 {
        let first = bc[bc.len() - 2];
        parts.extend(bc.windows(2).take(bc.len() - 2).map(|pair| [pair[0], pair[1], a]));
        parts.extend(ca.windows(2).map(|pair| [pair[0], pair[1], first]));
    } else {
        parts.extend(bc.windows(2).map(|pair| [pair[0], pair[1], last]));
        parts.extend(ca.windows(2).map(|pair| [pair[0], pair[1], first]));
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fan_has_a_triangle_more_than_corners_on_edges_and_each_piece_of_edge_once() {
        let edges: [[&[u32]; 3]; 5] = [
            [&[0, 1], &[1, 2], &[2, 0]],
            [&[0, 3, 1], &[1, 2], &[2, 0]],
            [&[0, 1], &[1, 3, 4, 2], &[2, 0]],
            [&[0, 1], &[1, 2], &[2, 3, 0]],
            [&[0, 3, 4, 1], &[1, 5, 2], &[2, 6, 7, 0]],
        ];
        for lines in edges {
            let inside: usize = lines.iter().map(|line| line.len() - 2).sum();
            let triangles = fan(lines);
            assert_eq!(triangles.len(), inside + 1, "{lines:?}");
            let sides = |[a, b, c]: &[u32; 3]| [(*a, *b), (*b, *c), (*c, *a)];
            let sides: Vec<(u32, u32)> = triangles.iter().flat_map(sides).collect();
            for pair in lines.iter().flat_map(|line| line.windows(2)) {
                assert_eq!(sides.iter().filter(|side| **side == (pair[0], pair[1])).count(), 1, "{lines:?}");
            }
        }
    }

    #[test]
    fn a_small_triangle_is_no_line() {
        let [a, b] = [DVec3::ZERO, DVec3::X];
        let with_height = |height: f64| [a, b, DVec3::new(0.5, height, 0.0)];
        assert!(is_line(with_height(1e-4)));
        assert!(!is_line(with_height(0.01)));
        assert!(!is_line(with_height(0.5).map(|corner| corner * 1e-9)));
    }
}
