//! The resources of a rank on its node: threads and a GPU.

use std::hash::{DefaultHasher, Hash, Hasher};

use lazygrid::Backend;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};

/// A rank among those of its node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Node {
    /// Its number among them, from 0 on.
    pub(crate) rank: usize,
    /// The number of ranks that may run on the same cores.
    sharing: usize,
}

impl Node {
    /// Of this process. Collective.
    pub(crate) fn of(comm: &SimpleCommunicator) -> Self {
        let node = comm.split_shared(comm.rank());
        let own = cores_hash();
        let mut all = vec![0_u64; node.size() as usize];
        node.all_gather_into(&own, &mut all[..]);
        Self { rank: node.rank() as usize, sharing: all.iter().filter(|&&other| other == own).count() }
    }

    /// Threads for this rank, unless it was told.
    pub(crate) fn threads(self) -> usize {
        let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get());
        (cores / self.sharing.max(1)).max(1)
    }

    /// The backend of this rank.
    pub(crate) fn place(self, asked: Backend) -> Place {
        match asked {
            Backend::Auto | Backend::Gpu => place(asked, self.rank, gpus()),
            _ => Place::Asked,
        }
    }
}

/// The default number of threads of a rank: its share of the cores that it and other ranks of its node may run on.
/// Collective.
pub fn threads(communicator: &impl Communicator) -> usize {
    Node::of(&communicator.duplicate()).threads()
}

/// The backend of a rank.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// As was asked for, with nothing to add.
    Asked,
    /// On the CPU.
    Cpu,
    /// On the GPU with this index.
    Gpu(usize),
}

/// Each of the first ranks of a node has a GPU of its own. The others compute on the CPU, or share GPUs where only GPUs
/// will do.
fn place(asked: Backend, rank: usize, gpus: usize) -> Place {
    match (asked, gpus) {
        // What there is besides real GPUs is for the detector to say.
        (_, 0) => Place::Asked,
        (Backend::Auto, gpus) if rank >= gpus => Place::Cpu,
        (_, gpus) => Place::Gpu(rank % gpus),
    }
}

/// Counts the real GPUs. They come first in the list of adapters.
#[cfg(feature = "gpu")]
fn gpus() -> usize {
    // Drivers take long to answer.
    static GPUS: std::sync::OnceLock<usize> = std::sync::OnceLock::new();
    *GPUS.get_or_init(|| lazygrid::gpu::adapters().iter().filter(|adapter| adapter.is_hardware).count())
}

#[cfg(not(feature = "gpu"))]
fn gpus() -> usize {
    0
}

/// Equal for processes of a node that may run on the same cores, and for all where the system does not say.
fn cores_hash() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let cores = status.lines().find(|line| line.starts_with("Cpus_allowed_list"));
    let mut hasher = DefaultHasher::new();
    cores.hash(&mut hasher);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_gpu_has_a_rank_of_its_own() {
        let places = |asked, gpus| (0..4).map(|rank| place(asked, rank, gpus)).collect::<Vec<_>>();
        assert_eq!(places(Backend::Auto, 0), [Place::Asked; 4]);
        assert_eq!(places(Backend::Auto, 2), [Place::Gpu(0), Place::Gpu(1), Place::Cpu, Place::Cpu]);
        assert_eq!(places(Backend::Gpu, 2), [Place::Gpu(0), Place::Gpu(1), Place::Gpu(0), Place::Gpu(1)]);
    }
}
