//! Receivers in groups of neighbours, and groups of groups: what is decided for a group need not be asked of its receivers.

use std::slice;

use glam::DVec3;

use crate::form_factor::{self, PreparedPolygon, ViewLanes};
use crate::geometry::lanes::{LANES, Vectors};
use crate::geometry::{Bounds, PlaneId};
use crate::replica::Receiver;

/// Groups that make a group of the next level.
const BRANCHING: usize = 4;

/// Receivers in a tree of groups. Neighbours in the list should be neighbours in space, but need not.
#[derive(Debug)]
pub struct ReceiverGroups {
    receivers: Vec<Receiver>,
    lanes: Vec<ReceiverLanes>,
    /// Level 0 has a node for each [`LANES`] receivers; the last level has one.
    levels: Vec<Vec<Node>>,
}

/// The receivers of a group side by side.
#[derive(Debug, Clone)]
pub struct ReceiverLanes {
    /// Their positions; the last is repeated where the group is not full.
    pub positions: Vectors,
    /// Positions and normals, as form factors want them.
    pub seeing: form_factor::ReceiverLanes,
    /// Their planes.
    pub planes: [PlaneId; LANES],
}

/// What is known of a group.
#[derive(Debug)]
pub struct Node {
    /// Box around the positions.
    pub bounds: Bounds,
    /// Planes that receivers lie in, ascending.
    pub planes: Vec<PlaneId>,
    /// Normal of all receivers, where it is one.
    pub normal: Option<DVec3>,
    /// Number of receivers.
    pub count: u32,
}

impl ReceiverGroups {
    /// Groups receivers in the order that they come in.
    #[must_use]
    pub fn new(receivers: Vec<Receiver>) -> Self {
        let lanes: Vec<ReceiverLanes> = receivers.chunks(LANES).map(ReceiverLanes::new).collect();
        let mut levels = vec![receivers.chunks(LANES).map(Node::around_receivers).collect::<Vec<_>>()];
        while let Some(last) = levels.last().filter(|level| level.len() > 1) {
            let next = last.chunks(BRANCHING).map(Node::around_nodes).collect();
            levels.push(next);
        }
        Self { receivers, lanes, levels }
    }

    /// The receivers, in order.
    #[must_use]
    pub fn receivers(&self) -> &[Receiver] {
        &self.receivers
    }

    /// The topmost level.
    pub(super) fn top(&self) -> usize {
        self.levels.len() - 1
    }

    /// A group.
    pub(super) fn node(&self, level: usize, index: usize) -> Option<&Node> {
        self.levels[level].get(index)
    }

    /// Numbers of the groups of the level below that make a group.
    pub(super) fn children(&self, level: usize, index: usize) -> std::ops::Range<usize> {
        let start = index * BRANCHING;
        start..(start + BRANCHING).min(self.levels[level - 1].len())
    }

    /// The receivers of a group of level 0.
    pub(super) fn lanes(&self, index: usize) -> &ReceiverLanes {
        &self.lanes[index]
    }
}

impl ReceiverLanes {
    /// Takes up to [`LANES`] receivers, and at least one.
    #[must_use]
    pub fn new(receivers: &[Receiver]) -> Self {
        let mut lanes = Self {
            positions: Vectors::ZERO,
            seeing: form_factor::ReceiverLanes::new(receivers.iter().map(|r| (r.position, r.normal))),
            planes: [PlaneId(0); LANES],
        };
        for i in 0..LANES {
            let receiver = &receivers[i.min(receivers.len() - 1)];
            lanes.positions.set(i, receiver.position);
            lanes.planes[i] = receiver.plane;
        }
        lanes
    }

    /// What they see of a polygon, within this relative error; nothing of one in their own plane.
    #[inline(always)]
    pub(super) fn view(&self, polygon: &PreparedPolygon, tolerance: f64) -> ViewLanes {
        let mut view = ViewLanes::default();
        polygon.view_row(slice::from_ref(&self.seeing), tolerance, slice::from_mut(&mut view));
        for lane in 0..LANES {
            if self.planes[lane] == polygon.plane() {
                (view.factors[lane], view.errors[lane]) = (0.0, 0.0);
            } else if view.unanswered >> lane & 1 == 1 {
                let alone = polygon.view(self.positions.get(lane), self.seeing.normal(lane), tolerance);
                (view.factors[lane], view.errors[lane]) =
                    alone.map_or((0.0, 0.0), |view| (view.factor, view.error));
            }
        }
        view
    }
}

impl Node {
    fn around_receivers(receivers: &[Receiver]) -> Self {
        let first = receivers[0].normal;
        Self {
            bounds: Bounds::around(receivers.iter().map(|receiver| receiver.position)),
            planes: sorted(receivers.iter().map(|receiver| receiver.plane)),
            normal: receivers.iter().all(|receiver| receiver.normal == first).then_some(first),
            count: receivers.len() as u32,
        }
    }

    fn around_nodes(nodes: &[Self]) -> Self {
        let normal = nodes[0].normal;
        Self {
            bounds: Bounds::around(nodes.iter().flat_map(|node| node.bounds.corners())),
            planes: sorted(nodes.iter().flat_map(|node| node.planes.iter().copied())),
            normal: normal.filter(|_| nodes.iter().all(|node| node.normal == normal)),
            count: nodes.iter().map(|node| node.count).sum(),
        }
    }
}

fn sorted(planes: impl Iterator<Item = PlaneId>) -> Vec<PlaneId> {
    let mut planes: Vec<PlaneId> = planes.collect();
    planes.sort_unstable();
    planes.dedup();
    planes
}
