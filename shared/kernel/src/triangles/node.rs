//! Eight boxes that a ray or a segment is tested against together.

use pulp::Simd;

use super::lanes::{LANES, Lanes, bits};
use super::sight::Rounded;

/// Part of the largest coordinate by which boxes are widened while a ray meets them: its origin and the products with the
/// inverse of its direction are rounded to f32, which together moves a crossing by up to 12 x 2^-24 of that coordinate.
const SLACK: f32 = 16.0 / 16_777_216.0;

/// A part of the tree.
pub(super) struct Node {
    /// Low and high coordinate of each child's box, for x, y and z; boxes of unused lanes are inside out.
    pub(super) bounds: [[Lanes; 3]; 2],
    /// Numbers of nodes or packets.
    pub(super) children: [u32; LANES],
    /// Which children are packets: the first child is the lowest bit.
    pub(super) packets: u8,
}

impl Node {
    pub(super) const EMPTY: Self = Self {
        bounds: [[Lanes([f32::INFINITY; LANES]); 3], [Lanes([f32::NEG_INFINITY; LANES]); 3]],
        children: [0; LANES],
        packets: 0,
    };
}

/// A ray, ready to meet boxes: each is the part of space between three pairs of planes.
pub(super) struct Slab {
    /// For each axis which of a box's sides is met first.
    first: [usize; 3],
    inverse: [f32; 3],
    /// The origin, moved so that boxes come nearer and end farther than they do.
    origins: [[f32; 3]; 2],
}

impl Slab {
    #[inline(always)]
    pub(super) fn new(ray: &Rounded) -> Self {
        let slack = SLACK * ray.reach;
        let Rounded { origin, inverse, .. } = *ray;
        let (mut first, mut origins) = ([0; 3], [origin; 2]);
        for axis in 0..3 {
            first[axis] = usize::from(inverse[axis].is_sign_negative());
            let slack = slack.copysign(inverse[axis]);
            origins[0][axis] = origin[axis] + slack;
            origins[1][axis] = origin[axis] - slack;
        }
        Self { first, inverse, origins }
    }

    /// Which of a node's boxes the ray may touch between two parts of its span: the first child is the lowest bit. `nears` are
    /// the parts at which it enters them, or less.
    #[inline(always)]
    pub(super) fn meets<S: Simd>(
        &self,
        simd: S,
        node: &Node,
        [start, end]: [f32; 2],
        nears: &mut Lanes,
    ) -> u8 {
        let mut met = 0;
        for part in 0..LANES / S::F32_LANES {
            let (mut near, mut far) = (simd.splat_f32s(start), simd.splat_f32s(end));
            for axis in 0..3 {
                let inverse = simd.splat_f32s(self.inverse[axis]);
                let side = self.first[axis];
                let (first, last) = (&node.bounds[side][axis], &node.bounds[1 - side][axis]);
                let first = simd.sub_f32s(first.load::<S>(part), simd.splat_f32s(self.origins[0][axis]));
                let last = simd.sub_f32s(last.load::<S>(part), simd.splat_f32s(self.origins[1][axis]));
                near = simd.max_f32s(near, simd.mul_f32s(first, inverse));
                far = simd.min_f32s(far, simd.mul_f32s(last, inverse));
            }
            nears.store::<S>(part, near);
            met |= bits(simd, simd.less_than_or_equal_f32s(near, far)) << (part * S::F32_LANES);
        }
        met
    }
}
