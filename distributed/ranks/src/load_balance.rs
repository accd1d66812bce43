#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LoadBalance {
    pub total: u64,
    pub most: u64,
    pub ranks: u32,
}

impl LoadBalance {
    /// With few spheres per rank, this surplus is no imbalance.
    const MIN_SURPLUS: f64 = 64.0;

    pub fn from_counts(each: &[u64]) -> Self {
        let most = each.iter().copied().max().unwrap_or(0);
        Self { total: each.iter().sum(), most, ranks: each.len() as u32 }
    }

    /// Returns the largest over the mean load; 1 without load.
    pub fn imbalance(&self) -> f64 {
        match self.total {
            0 => 1.0,
            total => self.most as f64 * f64::from(self.ranks) / total as f64,
        }
    }

    /// Returns `true` if a rank has more than `bound` times the mean load, and more than it had in a new partition,
    /// whose imbalance was `fresh`.
    pub fn is_imbalanced(&self, bound: f64, fresh: f64) -> bool {
        let mean = self.total as f64 / f64::from(self.ranks.max(1));
        self.most as f64 > mean * bound.max(fresh * 1.05) + Self::MIN_SURPLUS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn imbalance_ignores_a_few_spheres() {
        let even = LoadBalance::from_counts(&[1000, 1000, 1000, 1000]);
        assert_eq!((even.imbalance(), even.is_imbalanced(1.0, 1.0)), (1.0, false));
        let uneven = LoadBalance::from_counts(&[2000, 1000, 500, 500]);
        assert_eq!(uneven.imbalance(), 2.0);
        assert!(uneven.is_imbalanced(1.2, 1.0));
        assert!(!uneven.is_imbalanced(2.0, 1.0) && !uneven.is_imbalanced(1.2, 1.95));
        assert!(!LoadBalance::from_counts(&[7, 0, 0, 0]).is_imbalanced(1.0, 1.0));
        assert_eq!(LoadBalance::from_counts(&[]).imbalance(), 1.0);
    }
}
