//! Ghosts: spheres of other ranks that may pair with this rank's.

mod class_bounds;
pub mod ghost_rule;
mod rank_bounds;

use crate::communicator::agree_on_memory;
use crate::memory::try_collect;
use crate::{Communicator, Particle};

pub use class_bounds::ClassBounds;
pub use rank_bounds::RankBounds;

/// Sorted by owner.
#[derive(Clone, Debug, Default)]
pub struct Ghosts {
    particles: Vec<Particle>,
    /// First ghost of each rank, and the number of all.
    starts: Vec<usize>,
}

impl Ghosts {
    /// Creates ghosts from particles by rank, with counts. Drops particles beyond the counts.
    pub fn new(mut particles: Vec<Particle>, counts: &[usize]) -> Self {
        let mut starts = vec![0];
        for count in counts {
            starts.push((starts[starts.len() - 1] + count).min(particles.len()));
        }
        particles.truncate(starts[starts.len() - 1]);
        Self { particles, starts }
    }

    /// Sends the particles `leaving[rank]` to each rank, and receives this rank's ghosts. Collective.
    pub fn exchange<C: Communicator>(
        communicator: &mut C,
        leaving: &[Vec<u32>],
        particle: impl Fn(u32) -> Particle,
    ) -> Result<Self, C::Error> {
        let counts: Vec<usize> = leaving.iter().map(Vec::len).collect();
        let send = try_collect(counts.iter().sum(), leaving.iter().flatten().map(|&k| particle(k)), "ghosts");
        let send = agree_on_memory(communicator, send)?;
        let (ghosts, counts) = communicator.all_to_all_v("ghosts", &send, &counts)?;
        Ok(Self::new(ghosts, &counts))
    }

    pub fn particles(&self) -> &[Particle] {
        &self.particles
    }

    #[inline]
    pub fn rank_of(&self, k: u32) -> u32 {
        (self.starts.partition_point(|&start| start <= k as usize) - 1) as u32
    }
}
