/// Receivers of one group.
pub const GROUP: usize = u32::BITS as usize;

/// The row of a shooter: a factor for every receiver of a set, of which those that are 0 take no room.
///
/// In a building nearly all factors of a row are 0: they belong to other rooms. Receivers that lie close together stand close
/// together in a set, so that the others come in few groups. With every factor in use the groups add a sixteenth to the four
/// bytes of each.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Row {
    receivers: usize,
    /// Those with a factor that is not 0, by rising index.
    pub(super) groups: Box<[Group]>,
    /// Of all groups, in the order of the receivers.
    pub(super) factors: Box<[f32]>,
}

/// 32 receivers, at least one of which has a factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Group {
    /// Of its first receiver, over 32.
    pub index: u32,
    /// A bit for each receiver with a factor, the first receiver's lowest.
    pub mask: u32,
}

impl Group {
    fn first(self) -> usize {
        self.index as usize * GROUP
    }
}

/// A place between two groups of a row.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Place {
    group: u32,
    factor: u32,
}

impl Row {
    /// The row with these factors, one for each receiver.
    #[must_use]
    pub fn new(factors: &[f32]) -> Self {
        let mut groups = vec![];
        let mut kept = vec![];
        for (index, group) in (0..).zip(factors.chunks(GROUP)) {
            let bit = |(i, factor): (usize, &f32)| u32::from(*factor != 0.0) << i;
            let mask = group.iter().enumerate().fold(0, |mask, each| mask | bit(each));
            if mask != 0 {
                groups.push(Group { index, mask });
                kept.extend(group.iter().filter(|factor| **factor != 0.0));
            }
        }
        Self::from_parts(factors.len(), groups, kept)
    }

    /// A row over `receivers` receivers with these factors, in ascending order.
    #[must_use]
    pub fn of_some(receivers: usize, factors: &[(usize, f32)]) -> Self {
        let lit = || factors.iter().filter(|(_, factor)| *factor != 0.0);
        let mut groups: Vec<Group> = vec![];
        for (receiver, _) in lit() {
            let (index, bit) = ((receiver / GROUP) as u32, 1 << (receiver % GROUP));
            match groups.last_mut() {
                Some(group) if group.index == index => group.mask |= bit,
                _ => groups.push(Group { index, mask: bit }),
            }
        }
        Self::from_parts(receivers, groups, lit().map(|(_, factor)| *factor).collect())
    }

    /// The row with these factors, one for each receiver, of which only those in groups of 32 that are marked can be other than 0.
    /// What is not marked is not looked at.
    ///
    /// # Panics
    /// When there are fewer marks than groups.
    #[must_use]
    pub fn of_groups(factors: &[f64], marked: &[bool]) -> Self {
        let all = factors.chunks(GROUP).zip(&marked[..factors.len().div_ceil(GROUP)]);
        let lit = (0..).zip(all).filter(|(_, (_, is_marked))| **is_marked).map(|(i, (group, _))| (i, group));
        let mask = |group: &[f64]| {
            let bit = |(i, factor): (usize, &f64)| u32::from(*factor as f32 != 0.0) << i;
            group.iter().enumerate().fold(0, |mask, each| mask | bit(each))
        };
        let groups: Vec<Group> = lit
            .map(|(index, group)| Group { index, mask: mask(group) })
            .filter(|group| group.mask != 0)
            .collect();
        let count = groups.iter().map(|group| group.mask.count_ones() as usize).sum();
        let mut kept = Vec::with_capacity(count);
        for group in &groups {
            let mut mask = group.mask;
            while mask != 0 {
                kept.push(factors[group.first() + mask.trailing_zeros() as usize] as f32);
                mask &= mask.wrapping_sub(1);
            }
        }
        Self::from_parts(factors.len(), groups, kept)
    }

    /// Rows of consecutive receivers as one row. Each but the last is over whole groups of 32.
    ///
    /// # Panics
    /// When it is not.
    #[must_use]
    pub fn joined(parts: &[Self]) -> Self {
        let mut joined = Self::default();
        let (mut groups, mut factors) = (vec![], vec![]);
        for part in parts {
            assert!(joined.receivers.is_multiple_of(GROUP), "a part ends within a group");
            let first = (joined.receivers / GROUP) as u32;
            groups.extend(part.groups.iter().map(|group| Group { index: first + group.index, ..*group }));
            factors.extend_from_slice(&part.factors);
            joined.receivers += part.receivers;
        }
        Self::from_parts(joined.receivers, groups, factors)
    }

    pub(super) fn from_parts(receivers: usize, groups: Vec<Group>, factors: Vec<f32>) -> Self {
        Self { receivers, groups: groups.into(), factors: factors.into() }
    }

    /// Number of receivers, with a factor or without.
    #[must_use]
    pub fn receivers(&self) -> usize {
        self.receivers
    }

    /// Number of factors that are not 0.
    #[must_use]
    pub fn count(&self) -> usize {
        self.factors.len()
    }

    /// The factors that are not 0, each with the index of its receiver, by rising index.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f32)> + '_ {
        let indices = self.groups.iter().flat_map(|group| {
            let mut rest = group.mask;
            std::iter::from_fn(move || {
                let bit = (rest != 0).then(|| rest.trailing_zeros() as usize);
                rest &= rest.wrapping_sub(1);
                bit
            })
            .map(|bit| group.first() + bit)
        });
        indices.zip(self.factors.iter().copied())
    }

    /// Calls `visit` with the index and the factor of each receiver whose factor is not 0, by rising index. Faster than
    /// [`Self::iter`]: this is where a solution spends its time.
    pub fn for_each(&self, mut visit: impl FnMut(usize, f32)) {
        let mut rest = self.factors.as_ref();
        for group in &self.groups {
            let (own, others) = rest.split_at(group.mask.count_ones() as usize);
            rest = others;
            let first = group.first();
            if group.mask == u32::MAX {
                own.iter().enumerate().for_each(|(i, factor)| visit(first + i, *factor));
            } else {
                let mut mask = group.mask;
                for factor in own {
                    visit(first + mask.trailing_zeros() as usize, *factor);
                    mask &= mask.wrapping_sub(1);
                }
            }
        }
    }

    /// The receivers in groups of 32, those without a factor left out: the index of the first, a bit for each receiver that has a
    /// factor, the first one's lowest, and these factors. For work that goes faster on many receivers at a time.
    pub fn groups(&self) -> impl Iterator<Item = (usize, u32, &[f32])> {
        let mut rest = self.factors.as_ref();
        self.groups.iter().map(move |group| {
            let (own, others) = rest.split_at(group.mask.count_ones() as usize);
            rest = others;
            (group.first(), group.mask, own)
        })
    }

    /// Finds where each range of receivers begins in the row, and where the last one ends. Ranges begin at multiples of 32.
    ///
    /// # Panics
    /// When there is not one place more than there are ranges.
    pub fn find_places(&self, firsts: &[usize], places: &mut [Place]) {
        assert_eq!(places.len(), firsts.len() + 1, "a place for each range and the end");
        let (begins, end) = places.split_at_mut(firsts.len());
        let mut next = Place::default();
        for (place, first) in begins.iter_mut().zip(firsts) {
            let index = (first / GROUP) as u32;
            while let Some(group) = self.groups.get(next.group as usize).filter(|group| group.index < index) {
                next.group += 1;
                next.factor += group.mask.count_ones();
            }
            *place = next;
        }
        end[0] = Place { group: self.groups.len() as u32, factor: self.factors.len() as u32 };
    }

    /// As [`Self::groups`], from one place to another.
    pub fn groups_between(&self, from: Place, to: Place) -> impl Iterator<Item = (usize, u32, &[f32])> {
        let mut rest = &self.factors[from.factor as usize..to.factor as usize];
        self.groups[from.group as usize..to.group as usize].iter().map(move |group| {
            let (own, others) = rest.split_at(group.mask.count_ones() as usize);
            rest = others;
            (group.first(), group.mask, own)
        })
    }

    /// All factors, one for each receiver.
    #[must_use]
    pub fn to_dense(&self) -> Vec<f32> {
        let mut factors = vec![0.0; self.receivers];
        self.for_each(|receiver, factor| factors[receiver] = factor);
        factors
    }

    /// The factor of a receiver.
    #[must_use]
    pub fn factor(&self, receiver: usize) -> f32 {
        self.iter().find(|(index, _)| *index == receiver).map_or(0.0, |(_, factor)| factor)
    }

    /// Largest memory size of a row, in bytes.
    #[must_use]
    pub fn most_bytes(receivers: usize) -> usize {
        size_of::<Self>() + receivers.div_ceil(GROUP) * (size_of::<Group>() + GROUP * size_of::<f32>())
    }

    /// Memory size in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<Self>() + size_of_val::<[Group]>(&self.groups) + size_of_val::<[f32]>(&self.factors)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_row_has_the_factors_that_it_was_made_of(factors in prop::collection::vec(
            prop_oneof![3 => Just(0.0_f32), 1 => -1.0_f32..1.0], 0..300)) {
            let row = Row::new(&factors);
            prop_assert_eq!(row.to_dense(), &factors[..]);
            let others: Vec<(usize, f32)> =
                factors.iter().copied().enumerate().filter(|(_, factor)| *factor != 0.0).collect();
            prop_assert_eq!(row.iter().collect::<Vec<_>>(), &others[..]);
            prop_assert_eq!(&Row::of_some(factors.len(), &others), &row);
            let mut visited = vec![];
            row.for_each(|receiver, factor| visited.push((receiver, factor)));
            prop_assert_eq!(visited, others);
            let wide: Vec<f64> = factors.iter().map(|factor| f64::from(*factor)).collect();
            let is_lit = |group: &[f32]| group.iter().any(|factor| *factor != 0.0);
            let marks: Vec<bool> = factors.chunks(GROUP).map(is_lit).collect();
            prop_assert_eq!(&Row::of_groups(&wide, &marks), &row);
            prop_assert_eq!(&Row::of_groups(&wide, &vec![true; marks.len()]), &row);
            let in_groups: Vec<(usize, f32)> = row
                .groups()
                .flat_map(|(first, mask, own)| {
                    (0..GROUP).filter(move |i| mask >> i & 1 == 1).map(move |i| first + i).zip(own.iter().copied())
                })
                .collect();
            prop_assert_eq!(in_groups, row.iter().collect::<Vec<_>>());
            prop_assert!(factors.iter().enumerate().all(|(i, factor)| row.factor(i) == *factor));
            let firsts: Vec<usize> = (0..factors.len()).step_by(2 * GROUP).collect();
            let mut places = vec![Place::default(); firsts.len() + 1];
            row.find_places(&firsts, &mut places);
            let in_ranges: Vec<_> =
                places.windows(2).flat_map(|ends| row.groups_between(ends[0], ends[1])).collect();
            prop_assert_eq!(in_ranges, row.groups().collect::<Vec<_>>());
            let parts: Vec<Row> = factors.chunks(2 * GROUP).map(Row::new).collect();
            prop_assert_eq!(Row::joined(&parts), row);
        }
    }

    #[test]
    fn hidden_receivers_take_no_memory() {
        let mut factors = vec![0.0; 100_000];
        let nothing = Row::new(&factors).bytes();
        assert_eq!(nothing, size_of::<Row>());
        factors[50_000..50_064].fill(0.5);
        assert_eq!(Row::new(&factors).bytes(), nothing + 64 * 4 + 3 * 8);
    }
}
