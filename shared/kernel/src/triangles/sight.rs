//! A ray or a segment in f32.

use glam::DVec3;

/// Bound of the rounding of f32 in a corner seen along a ray, relative to the largest coordinate of scene and ray.
///
/// With u = 2^-24 and coordinates up to M: corner and origin are rounded to f32 and subtracted (4 u M), the shear has a relative
/// error of 4 u and a height of up to 2 M (14 u M in the product), and the difference of both is rounded (4 u M): 22 u M.
/// A side's determinant cx by - cy bx then is off by 22 u M (|bx| + |by| + |cx| + |cy|) from that, and its own rounding is
/// below 8 u M (|cx| + |cy|), as |bx| and |by| are at most 4 M. 40 covers both, and the rounding of the bound.
const ROUNDING: f32 = 40.0 / 16_777_216.0;

/// Least magnitude of a part of the span: its inverse is finite.
const LEAST_SPAN: f32 = 1e-30;

/// The axes in turn, by the last.
const AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// A ray or a segment in f32.
pub(super) struct Rounded {
    pub(super) origin: [f32; 3],
    pub(super) span: [f32; 3],
    /// Inverse of the span, finite.
    pub(super) inverse: [f32; 3],
    /// At least the largest coordinate of triangles, origin and end.
    pub(super) reach: f32,
}

impl Rounded {
    /// From where it starts, its span, the largest coordinate of the triangles, and the part of the span that may lie outside of
    /// them: all of a segment, nothing of a ray that is cut off behind the triangles.
    #[inline(always)]
    pub(super) fn new(origin: DVec3, span: DVec3, largest: f32, outside: f32) -> Self {
        let origin = [origin.x as f32, origin.y as f32, origin.z as f32];
        let span = [span.x as f32, span.y as f32, span.z as f32];
        let (mut inverse, mut reach) = (span, largest);
        for axis in 0..3 {
            let length = span[axis].abs();
            inverse[axis] =
                (1.0 / if length > LEAST_SPAN { length } else { LEAST_SPAN }).copysign(span[axis]);
            let farthest = origin[axis].abs() + outside * length;
            reach = if farthest > reach { farthest } else { reach };
        }
        Self { origin, span, inverse, reach }
    }

    /// False where a coordinate is no number, or none that f32 has: minima and maxima would pass over it, and meet everything.
    #[inline(always)]
    pub(super) fn is_finite(&self) -> bool {
        let [x, y, z] = self.origin;
        let [along_x, along_y, along_z] = self.span;
        ((x + y + z) + (along_x + along_y + along_z)).is_finite()
    }
}

/// Axes with the one of these along which it is longest last.
#[inline(always)]
pub(super) fn axes_along(span: [f32; 3]) -> [usize; 3] {
    // Arrays and conditional moves: which axis it is cannot be predicted.
    let lengths = span.map(f32::abs);
    let last = usize::from(lengths[1] > lengths[0]);
    AXES[if lengths[2] > lengths[last] { 2 } else { last }]
}

/// A ray or a segment, prepared for packets.
pub(super) struct Sight {
    /// The axis along which the span is longest comes last.
    pub(super) axes: [usize; 3],
    pub(super) origin: [f32; 3],
    /// How far the two other axes move along with the last.
    pub(super) shear: [f32; 2],
    /// Extent along the last axis.
    pub(super) depth: f32,
    /// Bound of the error of a sheared corner.
    pub(super) rounding: f32,
}

impl Sight {
    #[inline(always)]
    pub(super) fn new(rounded: &Rounded) -> Self {
        let Rounded { origin, span, inverse, reach } = rounded;
        let axes = axes_along(*span);
        let [x, y, z] = axes;
        Self {
            axes,
            origin: [origin[x], origin[y], origin[z]],
            shear: [span[x] * inverse[z], span[y] * inverse[z]],
            depth: span[z],
            rounding: ROUNDING * reach,
        }
    }
}
