//! Disjoint sets: items that are joined step by step.

/// Union-find with path halving; the representative of a set is its least item.
#[derive(Debug, Clone)]
pub struct DisjointSets {
    parents: Vec<usize>,
    count: usize,
}

impl DisjointSets {
    /// Sets of one item each.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self { parents: (0..count).collect(), count }
    }

    /// Number of sets.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The least item of the set that `item` is in.
    pub fn representative(&mut self, mut item: usize) -> usize {
        while self.parents[item] != item {
            self.parents[item] = self.parents[self.parents[item]];
            item = self.parents[item];
        }
        item
    }

    /// Joins the sets of two items.
    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.representative(a), self.representative(b));
        self.parents[a.max(b)] = a.min(b);
        self.count -= usize::from(a != b);
    }
}
