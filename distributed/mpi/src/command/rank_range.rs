use std::ops::Range;

pub(crate) fn rank_range(all: u64, rank: u64, ranks: u64) -> Range<u64> {
    let begin = |rank: u64| (u128::from(all) * u128::from(rank) / u128::from(ranks.max(1))) as u64;
    begin(rank)..begin(rank + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_cover_everything() {
        for (all, ranks) in [(0, 3), (7, 8), (1 << 60, 512), (1000, 7)] {
            let ranges: Vec<_> = (0..ranks).map(|rank| rank_range(all, rank, ranks)).collect();
            assert_eq!((ranges[0].start, ranges[ranges.len() - 1].end), (0, all));
            assert!(ranges.windows(2).all(|two| two[0].end == two[1].start));
            assert!(ranges.iter().all(|range| range.start <= range.end));
        }
    }
}
