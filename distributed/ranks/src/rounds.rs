use std::ops::Range;

use crate::Error;

/// The rounds in which ranks exchange what does not fit one message, as MPI counts elements in 32-bit integers.
///
/// In a round each rank sends at most `limit / ranks` elements to each other, so that neither what it sends nor what it
/// receives passes the limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rounds {
    share: u64,
}

impl Rounds {
    /// With at most `limit` elements in a message.
    ///
    /// # Errors
    /// [`Error::MessageLimit`] where the limit is less than one element per rank.
    pub fn new(limit: u64, ranks: u32) -> Result<Self, Error> {
        match limit / u64::from(ranks.max(1)) {
            0 => Err(Error::MessageLimit { limit, ranks }),
            share => Ok(Self { share }),
        }
    }

    /// How many rounds it takes when the most that any rank sends to any other is this many elements. All ranks have to
    /// agree on it.
    pub fn count(self, most: u64) -> u64 {
        most.div_ceil(self.share)
    }

    /// Which of `length` elements go in a round.
    pub fn range(self, length: u64, round: u64) -> Range<u64> {
        let start = round.saturating_mul(self.share).min(length);
        start..start.saturating_add(self.share).min(length)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_send_everything_once_within_the_limit() {
        for ranks in [1, 2, 3, 8] {
            for limit in u64::from(ranks)..30 {
                let rounds = Rounds::new(limit, ranks).unwrap();
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
        assert_eq!(Rounds::new(7, 8), Err(Error::MessageLimit { limit: 7, ranks: 8 }));
    }
}
