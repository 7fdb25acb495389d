//! Is a segment blocked?

use glam::DVec3;
use pulp::{Simd, WithSimd};
use smallvec::SmallVec;

use super::lanes::{LANES, Lanes};
use super::node::Slab;
use super::packet::Packet;
use super::sight::{Rounded, Sight, axes_along};
use super::tree::Tree;
use crate::geometry::PlaneId;

/// The number of a packet of triangles.
#[derive(Clone, Copy)]
pub struct PacketId(u32);

/// A segment, and which triangles cross it: as work for [`super::with_lanes`] it says in which packet one does, if any.
pub struct Segment<'a, F> {
    /// The triangles.
    pub tree: &'a Tree,
    /// Where it starts.
    pub from: &'a DVec3,
    /// What leads to its end.
    pub span: &'a DVec3,
    /// Triangles in these planes do not count.
    pub planes: [PlaneId; 2],
    /// The packet that is looked at first, if any.
    pub likely: Option<PacketId>,
    /// Whether the triangle with this number crosses it, where f32 does not tell.
    pub crosses: F,
}

impl<F: Fn(u32) -> bool> WithSimd for Segment<'_, F> {
    type Output = Option<PacketId>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Option<PacketId> {
        let tree = self.tree;
        if tree.nodes.is_empty() {
            return None;
        }
        let rounded = Rounded::new(*self.from, *self.span, tree.largest, 1.0);
        if !rounded.is_finite() {
            return None;
        }
        let sight = Sight::new(&rounded);
        if let Some(likely) = self.likely
            && let Some(packet) = tree.packets.get(likely.0 as usize)
            && self.is_blocked_by_one(simd, packet, &sight)
        {
            return self.likely;
        }
        let slab = Slab::new(&rounded);
        // Nodes with the children that are still to be looked at.
        let mut waiting = SmallVec::<[(u32, u8); 32]>::new();
        let mut current = 0_u32;
        loop {
            let node = &tree.nodes[current as usize];
            let met = slab.meets(simd, node, [0.0, 1.0], &mut Lanes([0.0; LANES]));
            let mut packets = met & node.packets;
            while packets != 0 {
                let first = node.children[packets.trailing_zeros() as usize];
                let blocking = self.blocking(simd, first, &sight);
                if blocking.is_some() {
                    return blocking;
                }
                packets &= packets - 1;
            }
            let mut nodes = met & !node.packets;
            if nodes == 0 {
                (current, nodes) = waiting.pop()?;
            }
            let next = tree.nodes[current as usize].children[nodes.trailing_zeros() as usize];
            let others = nodes & (nodes - 1);
            if others != 0 {
                waiting.push((current, others));
            }
            current = next;
        }
    }
}

impl<F: Fn(u32) -> bool> Segment<'_, F> {
    /// The packet that blocks the segment: this one or one of those that go on with it.
    #[inline(always)]
    fn blocking<S: Simd>(&self, simd: S, first: u32, sight: &Sight) -> Option<PacketId> {
        for (number, packet) in (first..).zip(&self.tree.packets[first as usize..]) {
            if self.is_blocked_by_one(simd, packet, sight) {
                return Some(PacketId(number));
            }
            if !packet.goes_on {
                break;
            }
        }
        None
    }

    #[inline(always)]
    fn is_blocked_by_one<S: Simd>(&self, simd: S, packet: &Packet, sight: &Sight) -> bool {
        for part in 0..LANES / S::F32_LANES {
            let (mut left, certain) = packet.crossed(simd, part, sight);
            while left != 0 {
                let bit = left.trailing_zeros() as usize;
                let lane = part * S::F32_LANES + bit;
                left &= left - 1;
                if self.planes.contains(&packet.planes[lane]) {
                    continue;
                }
                if certain >> bit & 1 == 1 || (self.crosses)(packet.first + lane as u32) {
                    return true;
                }
            }
        }
        false
    }
}

/// The test in f64, after Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013): sheared so that the segment
/// runs along one axis. An edge's side then is the sign of one 2-D determinant, which two triangles that share the edge
/// compute from the same numbers with opposite sign, so that at least one of them is hit; zero counts as a hit for both.
///
/// `clearance`: length of the segment, at either end, that does not count.
#[must_use]
pub fn crosses(corners: [DVec3; 3], from: DVec3, span: DVec3, clearance: f64) -> bool {
    // The axes of the test in f32, whichever of two equal ones that takes.
    let [x, y, z] = axes_along(span.as_vec3().to_array());
    let shear = [span[x] / span[z], span[y] / span[z]];
    let [a, b, c] = corners.map(|corner| {
        let relative = corner - from;
        let along = relative[z];
        DVec3::new(relative[x] - shear[0] * along, relative[y] - shear[1] * along, along / span[z])
    });
    let side = |a: DVec3, b: DVec3| a.x * b.y - a.y * b.x;
    let (u, v, w) = (side(c, b), side(a, c), side(b, a));
    let determinant = u + v + w;
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    if !inside || determinant == 0.0 {
        return false;
    }
    let part = (u * a.z + v * b.z + w * c.z) / determinant;
    let clearance = clearance / span.length();
    part > clearance && part < 1.0 - clearance
}
