/// Receivers of one group.
pub(super) const GROUP: usize = u32::BITS as usize;

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

    /// The row of so many receivers with these factors, by rising index.
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

    /// Memory that it takes.
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
            prop_assert!(factors.iter().enumerate().all(|(i, factor)| row.factor(i) == *factor));
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
