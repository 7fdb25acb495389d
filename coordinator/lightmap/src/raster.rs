//! Which texels a triangle covers, and how much of each.

use glam::DVec2;
use smallvec::SmallVec;

/// A convex polygon in texels.
type Polygon = SmallVec<[DVec2; 8]>;

/// Hands over each texel that a triangle covers a part of: its column and row, the area of the part, and its middle, in texels.
/// `size`: columns and rows of the page; what lies beyond them is left out.
pub fn covered(corners: [DVec2; 3], size: [u32; 2], mut take: impl FnMut([u32; 2], f64, DVec2)) {
    let triangle: Polygon = corners.into_iter().collect();
    each_slice(&triangle, 1, size[1], |row, strip| {
        each_slice(strip, 0, size[0], |column, piece| {
            let (area, middle) = area_and_middle(piece);
            if area > 0.0 {
                take([column, row], area, middle);
            }
        });
    });
}

/// Hands over the parts of a polygon in each unit interval of an axis.
fn each_slice(polygon: &Polygon, axis: usize, count: u32, mut take: impl FnMut(u32, &Polygon)) {
    let extent = |pick: fn(f64, f64) -> f64, start| polygon.iter().map(|p| p[axis]).fold(start, pick);
    let (low, high) = (extent(f64::min, f64::INFINITY), extent(f64::max, f64::NEG_INFINITY));
    if !(low.is_finite() && high.is_finite()) {
        return;
    }
    let first = low.floor().clamp(0.0, f64::from(count)) as u32;
    let end = high.ceil().clamp(0.0, f64::from(count)) as u32;
    for index in first..end {
        let (from, to) = (f64::from(index), f64::from(index + 1));
        if from <= low && high <= to {
            take(index, polygon);
            continue;
        }
        let part = clip(&clip(polygon, axis, from, 1.0), axis, to, -1.0);
        if part.len() >= 3 {
            take(index, &part);
        }
    }
}

/// What of a polygon lies on one side of a line: where `sign` times the coordinate is above `sign` times the bound.
fn clip(polygon: &Polygon, axis: usize, bound: f64, sign: f64) -> Polygon {
    let mut kept = Polygon::new();
    for (index, &a) in polygon.iter().enumerate() {
        let b = polygon[(index + 1) % polygon.len()];
        let (above, next) = (sign * (a[axis] - bound), sign * (b[axis] - bound));
        if above >= 0.0 {
            kept.push(a);
        }
        if (above > 0.0 && next < 0.0) || (above < 0.0 && next > 0.0) {
            kept.push(a.lerp(b, above / (above - next)));
        }
    }
    kept
}

/// Area of a polygon, whichever way it is wound, and its centroid.
fn area_and_middle(polygon: &Polygon) -> (f64, DVec2) {
    let origin = polygon[0];
    let (mut twice, mut moment) = (0.0, DVec2::ZERO);
    for pair in polygon[1..].windows(2) {
        let (a, b) = (pair[0] - origin, pair[1] - origin);
        let part = a.perp_dot(b);
        twice += part;
        moment += (a + b) * part;
    }
    let middle = if twice == 0.0 { origin } else { origin + moment / (3.0 * twice) };
    (twice.abs() / 2.0, middle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_sum_up_to_the_triangle() {
        let corners = [DVec2::new(0.3, 0.2), DVec2::new(7.9, 3.1), DVec2::new(2.5, 6.7)];
        let (mut area, mut moment, mut count) = (0.0, DVec2::ZERO, 0);
        covered(corners, [10, 10], |[column, row], part, middle| {
            let texel = DVec2::new(f64::from(column), f64::from(row));
            assert!((middle - texel).min_element() >= 0.0 && (middle - texel).max_element() <= 1.0);
            assert!(part <= 1.0 + 1e-12);
            (area, moment, count) = (area + part, moment + middle * part, count + 1);
        });
        let expected = (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]).abs() / 2.0;
        assert!((area - expected).abs() < 1e-12, "{area} {expected}");
        let centroid = corners.iter().sum::<DVec2>() / 3.0;
        assert!((moment / area).distance(centroid) < 1e-12);
        assert!(count > 20, "{count}");
    }

    #[test]
    fn what_lies_beyond_the_page_is_left_out() {
        let corners = [DVec2::new(-5.0, -5.0), DVec2::new(20.0, -5.0), DVec2::new(-5.0, 20.0)];
        let mut area = 0.0;
        covered(corners, [4, 4], |_, part, _| area += part);
        assert!((area - 16.0_f64).abs() < 1e-9, "{area}");
        covered([DVec2::NAN; 3], [4, 4], |_, _, _| panic!("nothing is covered"));
        covered([DVec2::ONE; 3], [4, 4], |_, _, _| panic!("nothing is covered"));
    }
}
