//! A sample of all spheres for a [`Partition`](crate::Partition): each rank takes those of its own that a hash of the id
//! chooses, so that no rank needs to know how many the others have.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::hash::{mix, tie};

/// Spheres of the sample per part. A part's size is off by about the reciprocal root of this, 1.1 %.
pub const PER_PART: u64 = 8192;
/// The most spheres of a sample, for any number of parts: 40 MB where they are gathered.
pub const MOST: u64 = 1 << 21;

/// A sphere of the sample, 20 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Sample {
    center: [f32; 3],
    /// The tie in two halves, because a 64-bit number would make it 24 bytes.
    tie: [u32; 2],
}

impl Sample {
    /// The sphere with this id; its centre as a [`Body`](crate::Body) has it.
    pub fn new(center: Vec3, id: u64) -> Self {
        let tie = tie(id);
        Self { center: center.to_array(), tie: [(tie >> 32) as u32, tie as u32] }
    }

    /// Its coordinate along an axis.
    #[inline]
    pub(crate) fn at(&self, axis: usize) -> f32 {
        self.center[axis]
    }

    #[inline]
    pub(crate) fn tie(&self) -> u64 {
        (u64::from(self.tie[0]) << 32) | u64::from(self.tie[1])
    }
}

/// Which spheres are in the sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// Those whose hash is no larger.
    most: u64,
}

impl Choice {
    /// Creates the filter for a number of spheres on all ranks and a number of parts.
    pub fn new(spheres: u64, parts: u32) -> Self {
        let wanted = (PER_PART * u64::from(parts)).min(MOST);
        let share = wanted as f64 / spheres.max(1) as f64;
        // A cast saturates, so that a share of one or more is everybody.
        Self { most: (share * 2_f64.powi(64)) as u64 }
    }

    /// Returns `true` if the sphere with this id is in it.
    #[inline]
    pub fn takes(self, id: u64) -> bool {
        // Not the tie, by which the sample would lie all on one side of a point that is to be halved.
        mix(id ^ 0x2545_F491_4F6C_DD1D) <= self.most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_as_large_as_they_should_be() {
        let taken = |spheres: u64, parts| {
            let choice = Choice::new(spheres, parts);
            (0..spheres).filter(|&id| choice.takes(id)).count() as u64
        };
        assert_eq!(taken(1000, 1), 1000);
        assert_eq!(taken(2 * PER_PART, 2), 2 * PER_PART);
        let few = taken(500_000, 2);
        assert!(few.abs_diff(2 * PER_PART) < 600, "{few}");
    }
}
