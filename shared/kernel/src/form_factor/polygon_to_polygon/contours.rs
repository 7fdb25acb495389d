//! The double contour sum of two polygons.

use glam::DVec3;
// Not those of f64, which are the platform's.
use libm::{atan2, hypot, log};

use super::gauss::rule;

/// Nodes on each piece of an edge.
const NODES: usize = 12;

/// A piece of an edge is integrated at once if the distances of every singular point from its two ends add up to this many of its
/// half lengths. The ellipse through that point with foci in the ends has half axes that add up to rho = 5.3 half lengths, from
/// rho + 1 / rho = 5.5, and the error of Gauss's rule is about rho^(-2 nodes) = 4e-18. Pieces of a half, a quarter, an eighth ...
/// of the edge on the way to a singular end have 6 and pass.
const CLEARANCE: f64 = 5.5;

/// A piece shorter than this part of its edge is integrated whatever is near: the integrand goes like s ln s at a singular point,
/// so the error is of the order of the square.
const SHORTEST: f64 = 1.0 / (1 << 30) as f64;

/// An edge of a polygon.
struct Edge {
    from: DVec3,
    to: DVec3,
    /// Unit vector.
    direction: DVec3,
    length: f64,
}

/// A place on an edge where the integrand is singular: at `along` if `aside` is 0, else at the complex pair
/// `along` +- i `aside`.
struct Singularity {
    along: f64,
    aside: f64,
}

/// Exchange area of two polygons of which each lies wholly in front of the other: 1/(2 pi) times the integral of
/// ln r dx . dy over both contours.
pub fn exchange_area(from: &[DVec3], to: &[DVec3]) -> f64 {
    let to = edges(to);
    let mut sum = 0.0;
    for outer in edges(from) {
        for inner in &to {
            let cosine = outer.direction.dot(inner.direction);
            if cosine != 0.0 {
                sum += cosine * edge_to_edge(&outer, inner);
            }
        }
    }
    sum / std::f64::consts::TAU
}

fn edges(corners: &[DVec3]) -> Vec<Edge> {
    let next = corners.iter().cycle().skip(1);
    let edge = |(&from, &to): (&DVec3, &DVec3)| {
        let length = from.distance(to);
        (length > 0.0).then(|| Edge { from, to, direction: (to - from) / length, length })
    };
    corners.iter().zip(next).filter_map(edge).collect()
}

/// The integral of ln r along both edges, up to a constant times the outer edge's length.
fn edge_to_edge(outer: &Edge, inner: &Edge) -> f64 {
    let singularities = singularities(outer, inner);
    let mut pieces = vec![(0.0, outer.length)];
    let mut sum = 0.0;
    while let Some((start, end)) = pieces.pop() {
        let is_clear = singularities.iter().all(|point| {
            let distance = |end: f64| hypot(point.along - end, point.aside);
            distance(start) + distance(end) >= CLEARANCE * 0.5 * (end - start)
        });
        if is_clear || end - start <= SHORTEST * outer.length {
            let value = |place: f64| logarithm_along(inner, outer.from + outer.direction * place);
            let nodes = rule(NODES).iter();
            let mean: f64 = nodes.map(|node| node.weight * value(start + (end - start) * node.place)).sum();
            sum += mean * (end - start);
        } else {
            let middle = f64::midpoint(start, end);
            pieces.push((start, middle));
            pieces.push((middle, end));
        }
    }
    sum
}

/// Where [`logarithm_along`] the inner edge is singular on the line of the outer edge: at the inner edge's ends and where the
/// line of the inner edge comes closest.
fn singularities(outer: &Edge, inner: &Edge) -> [Singularity; 3] {
    let at = |point: DVec3| {
        let offset = point - outer.from;
        Singularity { along: offset.dot(outer.direction), aside: offset.cross(outer.direction).length() }
    };
    let across = outer.direction.cross(inner.direction);
    let sine2 = across.length_squared();
    let offset = inner.from - outer.from;
    let lines = if sine2 > 0.0 {
        Singularity {
            along: offset.cross(inner.direction).dot(across) / sine2,
            aside: offset.dot(across) / sine2,
        }
    } else {
        // Parallel lines keep their distance.
        Singularity { along: f64::INFINITY, aside: 0.0 }
    };
    [at(inner.from), at(inner.to), lines]
}

/// The integral of ln |point - y| for y along an edge, without the edge's length, which drops out of a closed contour:
/// b ln r_b - a ln r_a + h theta, with a and b the ends of the edge from the foot of the point's perpendicular, r_a and r_b
/// their distances, h the perpendicular's length and theta the angle that the edge spans.
fn logarithm_along(edge: &Edge, point: DVec3) -> f64 {
    let (from, to) = (edge.from - point, edge.to - point);
    let (a, b) = (from.dot(edge.direction), to.dot(edge.direction));
    let height = from.cross(edge.direction).length();
    let end = |along: f64, corner: DVec3| {
        let square = corner.length_squared();
        if square > 0.0 { 0.5 * along * log(square) } else { 0.0 }
    };
    end(b, to) - end(a, from) + height * atan2(height * edge.length, from.dot(to))
}
