use std::ops::Range;

/// A rank's part of a list. The lengths of all parts differ by at most one.
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

    pub(crate) fn of(self, length: u64) -> Range<u64> {
        let start = |rank: u32| (u128::from(length) * u128::from(rank) / u128::from(self.ranks)) as u64;
        start(self.rank)..start(self.rank + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_partition_a_list_evenly() {
        for ranks in [1, 2, 3, 8] {
            for length in [0, 1, 7, 8, 1000, u64::MAX] {
                let shares = (0..ranks).map(|rank| RankSlice::new(rank, ranks).of(length));
                let mut next = 0;
                for share in shares {
                    assert!(
                        share.start == next
                            && (share.end - share.start).abs_diff(length / u64::from(ranks)) <= 1
                    );
                    next = share.end;
                }
                assert_eq!(next, length);
            }
        }
        assert_eq!(RankSlice::WHOLE.of(5), 0..5);
    }
}
