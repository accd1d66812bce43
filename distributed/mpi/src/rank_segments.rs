use std::ops::Range;

use lazygrid_ranks::MessageRounds;

#[derive(Clone, Debug)]
pub(crate) struct RankSegments {
    starts: Vec<usize>,
    lengths: Vec<usize>,
}

impl RankSegments {
    pub(crate) fn new(lengths: Vec<usize>) -> Self {
        let starts = lengths.iter().scan(0, |next, length| Some(std::mem::replace(next, *next + length)));
        Self { starts: starts.collect(), lengths }
    }

    pub(crate) fn lengths(&self) -> &[usize] {
        &self.lengths
    }

    pub(crate) fn total(&self) -> usize {
        self.lengths.iter().sum()
    }

    pub(crate) fn max_length(&self) -> usize {
        self.lengths.iter().copied().max().unwrap_or(0)
    }

    pub(crate) fn range(&self, rank: usize) -> Range<usize> {
        self.starts[rank]..self.starts[rank] + self.lengths[rank]
    }

    pub(crate) fn without(mut self, rank: usize) -> Self {
        self.lengths[rank] = 0;
        self
    }

    pub(crate) fn in_round(&self, rounds: MessageRounds, round: u64) -> Self {
        let ranges = self.lengths.iter().map(|&length| rounds.range(length as u64, round));
        let (mut starts, mut lengths) = (self.starts.clone(), Vec::with_capacity(self.lengths.len()));
        for (start, range) in starts.iter_mut().zip(ranges) {
            *start += range.start as usize;
            lengths.push((range.end - range.start) as usize);
        }
        Self { starts, lengths }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_cut_each_segment() {
        let segments = RankSegments::new(vec![3, 0, 5]);
        assert_eq!((segments.total(), segments.max_length(), segments.range(2)), (8, 5, 3..8));
        let rounds = MessageRounds::new(6, 3).unwrap();
        let ranges = |round| (0..3).map(|k| segments.in_round(rounds, round).range(k)).collect::<Vec<_>>();
        assert_eq!(ranges(0), [0..2, 3..3, 3..5]);
        assert_eq!(ranges(1), [2..3, 3..3, 5..7]);
        assert_eq!(ranges(2), [3..3, 3..3, 7..8]);
        assert_eq!(segments.without(2).lengths(), [3, 0, 0]);
    }
}
