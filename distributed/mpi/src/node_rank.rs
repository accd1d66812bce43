use std::hash::{DefaultHasher, Hash, Hasher};

use lazygrid::{Backend, Config};
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NodeRank {
    pub(crate) rank: usize,
    /// Ranks that may run on the same cores.
    sharing: usize,
}

impl NodeRank {
    /// Collective.
    pub(crate) fn new(comm: &SimpleCommunicator) -> Self {
        let node = comm.split_shared(comm.rank());
        let local = cores_hash();
        let mut all = vec![0_u64; node.size() as usize];
        node.all_gather_into(&local, &mut all[..]);
        Self { rank: node.rank() as usize, sharing: all.iter().filter(|&&other| other == local).count() }
    }

    pub(crate) fn threads(self) -> usize {
        let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get());
        (cores / self.sharing.max(1)).max(1)
    }

    pub(crate) fn device(self, backend: Backend) -> RankDevice {
        match backend {
            Backend::Auto | Backend::Gpu => rank_device(backend, self.rank, gpus()),
            _ => RankDevice::Requested,
        }
    }
}

/// Returns a rank's default number of threads, its share of the cores of its node. Collective.
pub fn threads(communicator: &impl Communicator) -> usize {
    NodeRank::new(&communicator.duplicate()).threads()
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RankDevice {
    Requested,
    Cpu,
    /// Index among hardware GPUs.
    Gpu(usize),
}

impl RankDevice {
    pub(crate) fn apply_to(self, detector: Config, backend: Backend) -> Config {
        match self {
            Self::Requested => detector.backend(backend),
            Self::Cpu => detector.backend(Backend::Cpu),
            #[cfg(feature = "gpu")]
            Self::Gpu(index) => detector.backend(backend).adapter(index),
            #[cfg(not(feature = "gpu"))]
            Self::Gpu(_) => detector.backend(backend),
        }
    }
}

/// Ranks without a GPU of their own take the CPU, or share GPUs if only GPUs are allowed.
fn rank_device(backend: Backend, rank: usize, gpus: usize) -> RankDevice {
    match (backend, gpus) {
        // The detector reports missing GPUs.
        (_, 0) => RankDevice::Requested,
        (Backend::Auto, gpus) if rank >= gpus => RankDevice::Cpu,
        (_, gpus) => RankDevice::Gpu(rank % gpus),
    }
}

/// Hardware GPUs come first among adapters.
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

/// Equal for processes that may run on the same cores.
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
        let devices = |backend, gpus| (0..4).map(|rank| rank_device(backend, rank, gpus)).collect::<Vec<_>>();
        assert_eq!(devices(Backend::Auto, 0), [RankDevice::Requested; 4]);
        assert_eq!(
            devices(Backend::Auto, 2),
            [RankDevice::Gpu(0), RankDevice::Gpu(1), RankDevice::Cpu, RankDevice::Cpu]
        );
        assert_eq!(
            devices(Backend::Gpu, 2),
            [RankDevice::Gpu(0), RankDevice::Gpu(1), RankDevice::Gpu(0), RankDevice::Gpu(1)]
        );
    }
}
