//! Spheres of other ranks that may pair with this rank's.

mod class_bounds;
pub mod ghost_rule;
mod rank_bounds;

use bytemuck::Pod;

use crate::communicator::{RankData, agree_on_memory};
use crate::memory::try_collect;
use crate::{Communicator, Particle};

pub use class_bounds::ClassBounds;
pub use rank_bounds::RankBounds;

#[derive(Clone, Debug, Default)]
pub struct Ghosts {
    particles: Vec<Particle>,
    /// Rows `x, y, z, r` if ranks decide in `f64`.
    doubles: Option<Vec<[f64; 4]>>,
    starts: Vec<usize>,
}

impl Ghosts {
    /// `particles` are by rank, with counts.
    pub fn new(mut particles: Vec<Particle>, counts: &[usize]) -> Self {
        let mut starts = vec![0];
        for count in counts {
            starts.push((starts[starts.len() - 1] + count).min(particles.len()));
        }
        particles.truncate(starts[starts.len() - 1]);
        Self { particles, doubles: None, starts }
    }

    /// Sends `leaving[rank]` to each rank, and receives this rank's ghosts. Collective.
    pub fn exchange<C: Communicator>(
        communicator: &mut C,
        leaving: &[Vec<u32>],
        particle: impl Fn(u32) -> Particle,
    ) -> Result<Self, C::Error> {
        let (ghosts, counts) = exchange(communicator, leaving, particle)?;
        Ok(Self::new(ghosts, &counts))
    }

    /// Also sends the `f64` rows `x, y, z, r`, which decide. Collective.
    pub fn exchange_f64<C: Communicator>(
        communicator: &mut C,
        leaving: &[Vec<u32>],
        particle: impl Fn(u32) -> Particle,
        row: impl Fn(u32) -> [f64; 4],
    ) -> Result<Self, C::Error> {
        let ghosts = Self::exchange(communicator, leaving, particle)?;
        let (rows, _) = exchange(communicator, leaving, row)?;
        Ok(Self { doubles: Some(rows), ..ghosts })
    }

    pub fn particles(&self) -> &[Particle] {
        &self.particles
    }

    pub(crate) fn doubles(&self) -> Option<&[[f64; 4]]> {
        self.doubles.as_deref()
    }

    #[inline]
    pub fn rank_of(&self, k: u32) -> u32 {
        (self.starts.partition_point(|&start| start <= k as usize) - 1) as u32
    }
}

fn exchange<T: Pod, C: Communicator>(
    communicator: &mut C,
    leaving: &[Vec<u32>],
    element: impl Fn(u32) -> T,
) -> Result<RankData<T>, C::Error> {
    let counts: Vec<usize> = leaving.iter().map(Vec::len).collect();
    let send = try_collect(counts.iter().sum(), leaving.iter().flatten().map(|&k| element(k)), "ghosts");
    let send = agree_on_memory(communicator, send)?;
    communicator.all_to_all_v("ghosts", &send, &counts)
}
