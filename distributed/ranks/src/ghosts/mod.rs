//! Ghosts: spheres of other ranks that may pair with spheres of this rank.

mod class_bounds;
pub mod ghost_rule;
mod rank_bounds;

use crate::communicator::agree_on_memory;
use crate::memory::try_collect;
use crate::{Communicator, Particle};

pub use class_bounds::ClassBounds;
pub use rank_bounds::RankBounds;

/// The spheres of other ranks that came to this rank, ordered by the rank that owns them.
#[derive(Clone, Debug, Default)]
pub struct Ghosts {
    particles: Vec<Particle>,
    /// The first ghost of each rank, and the number of all ghosts.
    starts: Vec<usize>,
}

impl Ghosts {
    /// Creates ghosts from the particles of rank 0, then those of rank 1 and so on, with the count of each rank. Particles
    /// beyond the sum of the counts are dropped.
    pub fn new(mut particles: Vec<Particle>, counts: &[usize]) -> Self {
        let mut starts = vec![0];
        for count in counts {
            starts.push((starts[starts.len() - 1] + count).min(particles.len()));
        }
        particles.truncate(starts[starts.len() - 1]);
        Self { particles, starts }
    }

    /// Sends the particles at the indices `leaving[rank]` to each rank, and receives the ghosts of this rank. Collective.
    ///
    /// # Errors
    /// Fails if the communicator fails.
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

    /// All ghosts.
    pub fn particles(&self) -> &[Particle] {
        &self.particles
    }

    /// The rank that owns ghost `k`.
    #[inline]
    pub fn rank_of(&self, k: u32) -> u32 {
        (self.starts.partition_point(|&start| start <= k as usize) - 1) as u32
    }
}
