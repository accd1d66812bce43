use std::ops::Range;

use crate::Error;

/// The rounds of an exchange that one message cannot carry, as MPI counts elements in 32-bit integers.
///
/// In a round each rank sends at most `limit / ranks` elements to each other rank, so neither sent nor received
/// elements exceed the limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageRounds {
    per_rank: u64,
}

impl MessageRounds {
    /// Creates rounds of at most `limit` elements per message.
    ///
    /// # Errors
    /// [`Error::MessageLimit`] if the limit is below one element per rank.
    pub fn new(limit: u64, ranks: u32) -> Result<Self, Error> {
        match limit / u64::from(ranks.max(1)) {
            0 => Err(Error::MessageLimit { limit, ranks }),
            per_rank => Ok(Self { per_rank }),
        }
    }

    /// Returns the number of rounds if no rank sends more than `most` elements to another. All ranks must give the same
    /// number.
    pub fn count(self, most: u64) -> u64 {
        most.div_ceil(self.per_rank)
    }

    /// Returns the range of `length` elements that a round sends.
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
