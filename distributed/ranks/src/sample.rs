//! A sample for a [`Partition`](crate::Partition), chosen by a hash of ids without messages.

use bytemuck::{Pod, Zeroable};

use crate::Coordinate;
use crate::hash::{mix, tie_breaker};

/// A domain's size errs by about 1.1 %, the reciprocal square root.
pub const SAMPLES_PER_DOMAIN: u64 = 8192;
/// The rank that gathers the samples needs 64 MB.
pub const MAX_SAMPLES: u64 = 1 << 21;

#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Sample {
    center: [f64; 3],
    tie_breaker: u64,
}

impl Sample {
    pub fn new<T: Coordinate>(center: [T; 3], id: u64) -> Self {
        Self { center: center.map(T::into), tie_breaker: tie_breaker(id) }
    }

    #[inline]
    pub(crate) fn at(&self, axis: usize) -> f64 {
        self.center[axis]
    }

    #[inline]
    pub(crate) fn tie_breaker(&self) -> u64 {
        self.tie_breaker
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleFilter {
    largest: u64,
}

impl SampleFilter {
    pub fn new(spheres: u64, domains: u32) -> Self {
        let wanted = (SAMPLES_PER_DOMAIN * u64::from(domains)).min(MAX_SAMPLES);
        let fraction = wanted as f64 / spheres.max(1) as f64;
        // The cast saturates: a fraction of 1 or more takes all.
        Self { largest: (fraction * 2_f64.powi(64)) as u64 }
    }

    #[inline]
    pub fn takes(self, id: u64) -> bool {
        // With the tie breaker's hash, all samples at one point would be on one side of its plane.
        mix(id ^ 0x2545_F491_4F6C_DD1D) <= self.largest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sample_has_the_requested_size() {
        let taken = |spheres: u64, domains| {
            let filter = SampleFilter::new(spheres, domains);
            (0..spheres).filter(|&id| filter.takes(id)).count() as u64
        };
        assert_eq!(taken(1000, 1), 1000);
        assert_eq!(taken(2 * SAMPLES_PER_DOMAIN, 2), 2 * SAMPLES_PER_DOMAIN);
        let few = taken(500_000, 2);
        assert!(few.abs_diff(2 * SAMPLES_PER_DOMAIN) < 600, "{few}");
    }
}
