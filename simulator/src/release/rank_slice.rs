use std::ops::Range;

/// A rank's range of a list. Lengths differ by at most one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RankSlice {
    rank: u32,
    ranks: u32,
}

impl RankSlice {
    pub(crate) const WHOLE: Self = Self { rank: 0, ranks: 1 };

    pub(crate) fn new(rank: u32, ranks: u32) -> Self {
        Self { rank, ranks }
    }

    pub(crate) fn is_first(self) -> bool {
        self.rank == 0
    }

    /// Ranges that are longer by one begin with rank `first_longer`, modulo the number of ranks.
    pub(crate) fn range(self, length: u64, first_longer: u32) -> Range<u64> {
        let ranks = u64::from(self.ranks);
        let (each, longer) = (length / ranks, length % ranks);
        let first = u64::from(first_longer) % ranks;
        let wrapped = (first + longer).saturating_sub(ranks);
        let start = |rank: u32| {
            let rank = u64::from(rank);
            rank * each + (rank.clamp(first, first + longer) - first) + rank.min(wrapped)
        };
        start(self.rank)..start(self.rank + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_partition_a_list_evenly() {
        for ranks in [1, 2, 3, 8] {
            for (length, first_longer) in
                [0, 1, 7, 8, 1000, u64::MAX].into_iter().flat_map(|n| [(n, 0), (n, 5)])
            {
                let slices = (0..ranks).map(|rank| RankSlice::new(rank, ranks).range(length, first_longer));
                let mut next = 0;
                for slice in slices {
                    assert!(
                        slice.start == next
                            && (slice.end - slice.start).abs_diff(length / u64::from(ranks)) <= 1
                    );
                    next = slice.end;
                }
                assert_eq!(next, length);
            }
        }
        assert_eq!(RankSlice::WHOLE.range(5, 3), 0..5);
    }

    #[test]
    fn short_lists_by_rotation_give_each_rank_equally_many() {
        for (ranks, length) in [(8, 1), (4, 2), (4, 3), (3, 2), (5, 7)] {
            let total = |rank| -> u64 {
                let slices = (0..ranks).map(|k| RankSlice::new(rank, ranks).range(length, k * length as u32));
                slices.map(|slice| slice.end - slice.start).sum()
            };
            assert!((0..ranks).all(|rank| total(rank) == length), "{ranks} {length}");
        }
    }
}
