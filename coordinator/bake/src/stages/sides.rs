//! Which sides of planes some points lie on.

use glam::DVec3;
use kernel::geometry::Bounds;

/// Points in a leaf.
const LEAF: usize = 16;

/// Rounding of a height, relative to the coordinates.
const ROUNDING: f64 = 1e-12;

/// Points by place: of a plane that all of them lie on one side of, only those near it are looked at.
pub struct PointTree {
    nodes: Vec<Node>,
    /// Those of a node together.
    points: Vec<DVec3>,
}

struct Node {
    around: Bounds,
    first: usize,
    count: usize,
    /// The second child, after all of the first one's, which is the next node; 0 at leaves.
    second: usize,
}

/// A plane by a point and its unit normal.
pub struct Plane {
    pub origin: DVec3,
    pub normal: DVec3,
    /// Heights up to this, on both sides, count as in the plane.
    pub tolerance: f64,
}

impl Plane {
    fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.origin)
    }

    /// Bounds of the heights of points in a box, their rounding included.
    fn heights(&self, around: &Bounds) -> (f64, f64) {
        let rounding = ROUNDING * (around.largest_coordinate() + self.origin.abs().max_element());
        let half = self.normal.abs().dot(around.half()) + rounding;
        let middle = self.height(around.centre());
        (middle - half, middle + half)
    }
}

impl PointTree {
    /// A tree of these points.
    pub fn new(points: Vec<DVec3>) -> Self {
        let all = points.len();
        let mut tree = Self { nodes: vec![], points };
        tree.build(0, all);
        tree
    }

    fn build(&mut self, first: usize, count: usize) {
        let own = &mut self.points[first..first + count];
        let around = Bounds::around(own.iter());
        let node = self.nodes.len();
        self.nodes.push(Node { around, first, count, second: 0 });
        if count <= LEAF {
            return;
        }
        let axis = around.extent().max_position();
        let half = count / 2;
        own.select_nth_unstable_by(half, |a, b| a[axis].total_cmp(&b[axis]));
        self.build(first, half);
        self.nodes[node].second = self.nodes.len();
        self.build(first + half, count - half);
    }

    /// Whether there is a point above a plane, or it is known that there is one, and the same below.
    pub fn sides(&self, plane: &Plane, known: [bool; 2]) -> [bool; 2] {
        self.look(plane, known).0
    }

    /// The sides, and how many points were looked at.
    fn look(&self, plane: &Plane, [mut above, mut below]: [bool; 2]) -> ([bool; 2], usize) {
        let mut looked = 0;
        let mut waiting = vec![0];
        while let Some(index) = waiting.pop() {
            if above && below {
                break;
            }
            let node = &self.nodes[index];
            let (least, most) = plane.heights(&node.around);
            let tells_nothing = (above || most <= plane.tolerance) && (below || least >= -plane.tolerance);
            if tells_nothing {
                continue;
            }
            if node.second > 0 {
                waiting.extend([node.second, index + 1]);
                continue;
            }
            looked += node.count;
            for point in &self.points[node.first..node.first + node.count] {
                let height = plane.height(*point);
                above |= height > plane.tolerance;
                below |= height < -plane.tolerance;
            }
        }
        ([above, below], looked)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Evenly in [-1, 1], a fixed sequence.
    fn part(index: usize, step: f64) -> f64 {
        2.0 * (index as f64 * step).fract() - 1.0
    }

    fn direction(index: usize) -> DVec3 {
        let turn = std::f64::consts::PI * part(index, 0.618_034);
        let height = part(index, 0.754_877_67);
        let flat = (1.0 - height * height).sqrt();
        DVec3::new(flat * turn.cos(), flat * turn.sin(), height)
    }

    #[test]
    fn sides_are_those_of_all_points() {
        let points: Vec<DVec3> = (0..500)
            .map(|index| {
                // Some lie in the same planes.
                let point = DVec3::new(part(index, 0.754_877_67), part(index, 0.569_84), part(index, 0.32));
                if index.is_multiple_of(2) { (8.0 * point).round() / 8.0 } else { point }
            })
            .collect();
        let tree = PointTree::new(points.clone());
        for index in 0..2000_usize {
            let normal = if index.is_multiple_of(3) { DVec3::AXES[index % 9 / 3] } else { direction(index) };
            let origin = 1.1 * part(index, 0.447) * normal;
            let plane = Plane { origin, normal, tolerance: [0.0, 3e-4, 0.1][index % 3] };
            let known = [index.is_multiple_of(5), index.is_multiple_of(7)];
            let heights = || points.iter().map(|point| plane.height(*point));
            let above = known[0] || heights().any(|height| height > plane.tolerance);
            let below = known[1] || heights().any(|height| height < -plane.tolerance);
            assert_eq!(tree.sides(&plane, known), [above, below], "plane {index}");
        }
        assert_eq!(
            PointTree::new(vec![])
                .sides(&Plane { origin: DVec3::ZERO, normal: DVec3::X, tolerance: 0.0 }, [false; 2]),
            [false; 2]
        );
    }

    /// The faces of a round room have all points on one side: each would have to look at all of them.
    #[test]
    fn faces_of_a_round_room_look_at_few_points() {
        let looked = |count: usize| {
            let points: Vec<DVec3> = (0..count).map(|index| 1024.0 * direction(index)).collect();
            let tree = PointTree::new(points.clone());
            let planes = points.iter().step_by(count / 100);
            let looked = planes.map(|point| {
                let plane = Plane { origin: *point, normal: -point.normalize(), tolerance: 3e-4 };
                let (sides, looked) = tree.look(&plane, [false; 2]);
                assert_eq!(sides, [true, false]);
                looked
            });
            looked.sum::<usize>() / 100
        };
        let (some, many) = (looked(2000), looked(200_000));
        // Boxes that are not along a face stick out of it: as many as there are along a great circle.
        assert!(many < 20 * some, "{some} of 2,000 points and {many} of 200,000 for each face");
    }
}
