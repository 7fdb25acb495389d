//! Which items hang together.

/// Union-find with path halving; the representative of a set is its least item.
pub(crate) struct DisjointSets(Vec<usize>);

impl DisjointSets {
    /// So many sets of one item each.
    pub(crate) fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    /// The least item of the set that `item` is in.
    pub(crate) fn representative(&mut self, mut item: usize) -> usize {
        while self.0[item] != item {
            self.0[item] = self.0[self.0[item]];
            item = self.0[item];
        }
        item
    }

    /// Makes the sets of two items one.
    pub(crate) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.representative(a), self.representative(b));
        self.0[a.max(b)] = a.min(b);
    }
}
