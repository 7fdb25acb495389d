//! Rows kept in a given amount of memory.
//!
//! A solution passes over all rows again and again, in the same order: replacing a kept row by the next would only mean to make
//! it again a pass later. In shooting, too, the first to shoot shoot again soonest. So rows are kept while they fit, and stay.

use kernel::row::Row;

use super::ShareId;

/// Number of a set of receivers, in the order in which sets were added.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SetId(pub u32);

impl SetId {
    /// As an index into arrays over sets.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Rows of shares over sets of receivers.
#[derive(Debug, Default)]
pub struct RowCache {
    /// Most bytes.
    limit: usize,
    /// Bytes of these reserved for others.
    reserved: usize,
    used: usize,
    /// By set, then by share.
    rows: Vec<Vec<Option<Row>>>,
    /// Kept rows, oldest first.
    order: Vec<(SetId, ShareId)>,
    most: usize,
}

impl RowCache {
    /// A cache of so many bytes.
    #[must_use]
    pub fn new(bytes: usize) -> Self {
        Self { limit: bytes, ..Self::default() }
    }

    /// Makes room for the rows of so many shares over one more set of receivers.
    pub fn add_set(&mut self, shares: usize) -> SetId {
        self.rows.push(vec![None; shares]);
        SetId(self.rows.len() as u32 - 1)
    }

    /// The row of a share, if it was kept.
    #[must_use]
    pub fn row(&self, set: SetId, share: ShareId) -> Option<&Row> {
        self.rows[set.index()][share.index()].as_ref()
    }

    /// Keeps a row if it fits.
    pub fn keep(&mut self, set: SetId, share: ShareId, row: Row) {
        let fits = self.used + row.bytes() <= self.limit - self.reserved;
        let place = &mut self.rows[set.index()][share.index()];
        if fits && place.is_none() {
            self.used += row.bytes();
            *place = Some(row);
            self.order.push((set, share));
            self.most = self.most.max(self.used);
        }
    }

    /// Reserves bytes for others, at most all, and drops the youngest rows where needed. Returns the bytes reserved.
    pub fn reserve(&mut self, bytes: usize) -> usize {
        self.reserved = bytes.min(self.limit);
        while self.used > self.limit - self.reserved {
            let Some((set, share)) = self.order.pop() else { break };
            let row = self.rows[set.index()][share.index()].take();
            self.used -= row.map_or(0, |row| row.bytes());
        }
        self.reserved
    }

    /// Bytes of the rows.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.used
    }

    /// Bytes left for more rows.
    #[must_use]
    pub fn room(&self) -> usize {
        (self.limit - self.reserved).saturating_sub(self.used)
    }

    /// Most bytes so far.
    #[must_use]
    pub fn most_bytes(&self) -> usize {
        self.most
    }
}

/// Factors between shares, as rows over the shares: kept while they fit, as in [`RowCache`].
#[derive(Debug)]
pub struct ColumnCache {
    limit: usize,
    used: usize,
    columns: Vec<Option<Row>>,
}

impl ColumnCache {
    /// A cache of so many bytes, for so many shares.
    #[must_use]
    pub fn new(bytes: usize, shares: usize) -> Self {
        Self { limit: bytes, used: 0, columns: vec![None; shares] }
    }

    /// The column of a share, if it was kept.
    #[must_use]
    pub fn column(&self, share: ShareId) -> Option<&Row> {
        self.columns[share.index()].as_ref()
    }

    /// Keeps a column if it fits.
    pub fn keep(&mut self, share: ShareId, column: Row) {
        if self.used + column.bytes() <= self.limit {
            self.used += column.bytes();
            self.columns[share.index()] = Some(column);
        }
    }

    /// Bytes of the columns.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.used
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> Row {
        Row::new(&[0.5; 64])
    }

    fn kept(cache: &RowCache, set: SetId) -> Vec<u32> {
        (0..4).filter(|share| cache.row(set, ShareId(*share)).is_some()).collect()
    }

    #[test]
    fn rows_are_kept_while_they_fit() {
        let mut cache = RowCache::new(2 * row().bytes() + 1);
        let set = cache.add_set(4);
        for share in [2, 0, 3, 1] {
            cache.keep(set, ShareId(share), row());
        }
        assert_eq!(kept(&cache, set), [0, 2]);
        assert_eq!(cache.bytes(), 2 * row().bytes());
        // A row that is there already takes no second place.
        cache.keep(set, ShareId(0), row());
        assert_eq!(cache.bytes(), 2 * row().bytes());
    }

    #[test]
    fn the_youngest_rows_make_place() {
        let mut cache = RowCache::new(3 * row().bytes());
        let set = cache.add_set(4);
        for share in [2, 0, 3] {
            cache.keep(set, ShareId(share), row());
        }
        assert_eq!(cache.reserve(2 * row().bytes()), 2 * row().bytes());
        assert_eq!(kept(&cache, set), [2]);
        cache.keep(set, ShareId(1), row());
        assert_eq!(kept(&cache, set), [2], "what is reserved is not for rows");
        cache.reserve(0);
        cache.keep(set, ShareId(1), row());
        assert_eq!(kept(&cache, set), [1, 2]);
        assert_eq!((cache.bytes(), cache.most_bytes()), (2 * row().bytes(), 3 * row().bytes()));
    }

    #[test]
    fn a_cache_of_nothing_keeps_nothing() {
        let mut cache = RowCache::new(0);
        let set = cache.add_set(4);
        assert_eq!(cache.reserve(100), 0);
        cache.keep(set, ShareId(0), row());
        assert_eq!((kept(&cache, set).len(), cache.most_bytes()), (0, 0));
    }

    #[test]
    fn columns_are_kept_while_they_fit() {
        let mut columns = ColumnCache::new(row().bytes(), 2);
        columns.keep(ShareId(1), row());
        columns.keep(ShareId(0), row());
        assert_eq!(columns.column(ShareId(1)), Some(&row()));
        assert!(columns.column(ShareId(0)).is_none());
        assert_eq!(columns.bytes(), row().bytes());
    }
}
