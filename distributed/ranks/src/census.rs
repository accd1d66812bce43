/// The distribution of something among ranks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Census {
    /// Of all ranks together.
    pub total: u64,
    /// Of the rank that has most.
    pub most: u64,
    /// The number of ranks.
    pub ranks: u32,
}

impl Census {
    /// Spheres that a rank may have above its share before that counts as imbalance: where ranks have few, one more or
    /// less is a large part, and costs nothing.
    const SLACK: f64 = 64.0;

    /// Of what each rank has.
    pub fn of(each: &[u64]) -> Self {
        let most = each.iter().copied().max().unwrap_or(0);
        Self { total: each.iter().sum(), most, ranks: each.len() as u32 }
    }

    /// Largest over mean; 1 if there is nothing.
    pub fn imbalance(&self) -> f64 {
        match self.total {
            0 => 1.0,
            total => self.most as f64 * f64::from(self.ranks) / total as f64,
        }
    }

    /// Returns `true` if some rank has more than `bound` times its share. A partition that was no better when it was
    /// `fresh` would not get better by being made again.
    pub fn exceeds(&self, bound: f64, fresh: f64) -> bool {
        let share = self.total as f64 / f64::from(self.ranks.max(1));
        self.most as f64 > share * bound.max(fresh * 1.05) + Self::SLACK
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn imbalance_counts_where_it_costs() {
        let even = Census::of(&[1000, 1000, 1000, 1000]);
        assert_eq!((even.imbalance(), even.exceeds(1.0, 1.0)), (1.0, false));
        let uneven = Census::of(&[2000, 1000, 500, 500]);
        assert_eq!(uneven.imbalance(), 2.0);
        assert!(uneven.exceeds(1.2, 1.0) && !uneven.exceeds(2.0, 1.0) && !uneven.exceeds(1.2, 1.95));
        assert!(!Census::of(&[7, 0, 0, 0]).exceeds(1.0, 1.0));
        assert_eq!(Census::of(&[]).imbalance(), 1.0);
    }
}
