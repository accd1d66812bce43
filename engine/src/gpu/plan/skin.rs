//! The buffers and dispatches of a candidate list, besides those of the search that builds it.

use lazygrid_kernels::kernel as k;
use lazygrid_kernels::layout::{Outcome, SkinState};

use super::buffers::{BufferId, bytes_of};
use super::dispatches::{Dispatch, GpuPhase};

/// The state of candidates, which is new whenever they are.
pub(in crate::gpu) const STATE: (BufferId, u64) = (BufferId::SkinState, size_of::<SkinState>() as u64);

/// The buffers for these numbers of spheres and pairs.
pub(in crate::gpu) fn buffers(spheres: u32, pairs: u32, species: bool) -> Vec<(BufferId, u64)> {
    let mut buffers = vec![
        (BufferId::ReferenceSpheres, bytes_of(spheres, 16)),
        (BufferId::DispatchArgs, 16),
        (BufferId::Outcome, size_of::<Outcome>() as u64),
        (BufferId::Pairs, bytes_of(pairs, 8)),
    ];
    if species {
        buffers.push((BufferId::ReferenceSpecies, bytes_of(spheres, 4)));
    }
    buffers
}

/// Returns the dispatches before and after the search for candidates.
pub(in crate::gpu) fn dispatches(spheres: u32) -> [Vec<Dispatch>; 2] {
    let per_sphere = spheres.div_ceil(k::WORKGROUP_SIZE);
    let before = vec![
        Dispatch::new(&k::SKIN_DISPLACEMENT, per_sphere, GpuPhase::Survey),
        Dispatch::new(&k::SKIN_CHECK, 1, GpuPhase::Survey),
        Dispatch::new(&k::SKIN_STORE_REFERENCE, per_sphere, GpuPhase::Survey),
    ];
    let after = vec![
        Dispatch::new(&k::CANDIDATES_TEST_DISPATCH_ARGS, 1, GpuPhase::Search),
        Dispatch::indirect(&k::CANDIDATES_TEST, GpuPhase::Search),
        Dispatch::new(&k::OUTCOME_FINISH, 1, GpuPhase::Search),
    ];
    [before, after]
}
