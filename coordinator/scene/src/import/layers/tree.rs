use glam::DVec2;

use super::Outline;

/// Outlines in a leaf.
const LEAF: usize = 8;

/// Outlines by place, to find those that overlap one and come before it.
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// Numbers of the outlines, leaf by leaf.
    order: Vec<u32>,
    /// Of each outline, made smaller by half of the tolerance on all sides: neighbours do not meet.
    boxes: Vec<Box2>,
}

#[derive(Clone, Copy)]
struct Box2 {
    low: DVec2,
    high: DVec2,
}

struct Node {
    around: Box2,
    /// Least number in it.
    first: u32,
    /// Of a leaf: its part of the order. Of others: the right child, after all of the left one's, and 0.
    start: u32,
    count: u32,
}

impl Box2 {
    fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    fn meets(&self, other: &Self) -> bool {
        self.low.cmplt(other.high).all() && self.high.cmpgt(other.low).all()
    }
}

impl Tree {
    /// A tree over outlines with corners.
    pub(super) fn new(outlines: &[Outline], tolerance: f64) -> Self {
        let around = |outline: &Outline| {
            let low = outline.iter().copied().reduce(DVec2::min).unwrap_or(DVec2::INFINITY);
            let high = outline.iter().copied().reduce(DVec2::max).unwrap_or(DVec2::NEG_INFINITY);
            Box2 { low: low + tolerance / 2.0, high: high - tolerance / 2.0 }
        };
        let mut tree = Self {
            nodes: vec![],
            order: (0..outlines.len() as u32).collect(),
            boxes: outlines.iter().map(around).collect(),
        };
        if !outlines.is_empty() {
            tree.build(0, outlines.len());
        }
        tree
    }

    fn build(&mut self, start: usize, end: usize) {
        let Self { nodes, order, boxes } = self;
        let own = &mut order[start..end];
        let all = own.iter().map(|index| boxes[*index as usize]);
        let around = all.reduce(Box2::union).unwrap_or(boxes[0]);
        let first = own.iter().copied().min().unwrap_or(0);
        let node = nodes.len();
        nodes.push(Node { around, first, start: start as u32, count: (end - start) as u32 });
        if own.len() <= LEAF {
            return;
        }
        let size = around.high - around.low;
        let middle = |index: &u32| {
            let Box2 { low, high } = boxes[*index as usize];
            if size.x >= size.y { low.x + high.x } else { low.y + high.y }
        };
        let half = own.len() / 2;
        own.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
        self.build(start, start + half);
        self.nodes[node].start = self.nodes.len() as u32;
        self.nodes[node].count = 0;
        self.build(start + half, end);
    }

    /// Whether `is_meant` says so of any outline before this one whose box overlaps its box.
    pub(super) fn any_before(&self, own: usize, mut is_meant: impl FnMut(usize) -> bool) -> bool {
        let around = &self.boxes[own];
        let mut waiting = vec![0_u32];
        while let Some(index) = waiting.pop() {
            let Some(node) = self.nodes.get(index as usize) else { continue };
            if node.first as usize >= own || !node.around.meets(around) {
                continue;
            }
            if node.count == 0 {
                waiting.extend([node.start, index + 1]);
                continue;
            }
            let (start, end) = (node.start as usize, (node.start + node.count) as usize);
            for other in self.order[start..end].iter().map(|other| *other as usize) {
                if other < own && self.boxes[other].meets(around) && is_meant(other) {
                    return true;
                }
            }
        }
        false
    }
}
