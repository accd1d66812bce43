use std::ops::Range;

use crate::Error;

/// Rounds of an exchange, each with at most `limit / ranks` elements between two ranks, so that no rank sends or
/// receives more than the limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageRounds {
    per_rank: u64,
}

impl MessageRounds {
    /// # Errors
    /// [`Error::MessageLimit`] below one element per rank.
    pub fn new(limit: u64, ranks: u32) -> Result<Self, Error> {
        match limit / u64::from(ranks.max(1)) {
            0 => Err(Error::MessageLimit { limit, ranks }),
            per_rank => Ok(Self { per_rank }),
        }
    }

    /// `most` is the largest number of elements between any two ranks.
    pub fn count(self, most: u64) -> u64 {
        most.div_ceil(self.per_rank)
    }

    pub fn range(self, length: u64, round: u64) -> Range<u64> {
        let start = round.saturating_mul(self.per_rank).min(length);
        start..start.saturating_add(self.per_rank).min(length)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_send_everything_once_within_the_limit() {
        for ranks in [1, 2, 3, 8] {
            for limit in u64::from(ranks)..30 {
                let rounds = MessageRounds::new(limit, ranks).unwrap();
                for length in 0..50 {
                    let ranges = (0..rounds.count(length)).map(|round| rounds.range(length, round));
                    let mut next = 0;
                    for range in ranges {
                        assert!(range.start == next && !range.is_empty());
                        assert!((range.end - range.start) * u64::from(ranks) <= limit);
                        next = range.end;
                    }
                    assert_eq!(next, length);
                    assert!(rounds.range(length, rounds.count(length)).is_empty());
                }
            }
        }
        assert_eq!(MessageRounds::new(7, 8), Err(Error::MessageLimit { limit: 7, ranks: 8 }));
    }
}
