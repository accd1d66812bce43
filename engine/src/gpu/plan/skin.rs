use lazygrid_kernels::kernel as k;
use lazygrid_kernels::layout::{Outcome, SkinState};

use super::buffers::{BufferId, bytes_of};
use super::dispatches::{Dispatch, GpuPhase, interleave};
use super::work_budget::WorkBudget;

/// State of a candidate list; every list has a new buffer.
pub(crate) const STATE: (BufferId, u64) = (BufferId::SkinState, size_of::<SkinState>() as u64);

/// Returns the number of dispatches and their workgroups.
pub(crate) fn candidate_parts(candidates: u32, budget: WorkBudget) -> (u32, u32) {
    let groups = candidates.div_ceil(k::WORKGROUP_SIZE).max(1);
    let per_dispatch = budget.groups_per_dispatch(groups, k::WORKGROUP_SIZE.into());
    (groups.div_ceil(per_dispatch), per_dispatch)
}

pub(crate) fn buffers(
    [spheres, pairs, parts]: [u32; 3],
    species: bool,
    columns: bool,
) -> Vec<(BufferId, u64)> {
    let mut buffers = vec![
        (BufferId::ReferenceSpheres, bytes_of(spheres, 16)),
        (BufferId::DispatchArgs, bytes_of(parts, 12)),
        (BufferId::Outcome, size_of::<Outcome>() as u64),
        (BufferId::Pairs, bytes_of(pairs, 8)),
    ];
    if columns {
        buffers.push((BufferId::Rows, bytes_of(spheres, 16)));
    }
    if species {
        buffers.push((BufferId::ReferenceSpecies, bytes_of(spheres, 4)));
    }
    buffers
}

pub(crate) fn dispatches(spheres: u32, columns: bool, parts: u32, per_dispatch: u32) -> [Vec<Dispatch>; 2] {
    let per_sphere = spheres.div_ceil(k::WORKGROUP_SIZE);
    let mut before = vec![
        Dispatch::new(&k::SKIN_DISPLACEMENT, per_sphere, GpuPhase::Survey),
        Dispatch::new(&k::SKIN_CHECK, 1, GpuPhase::Survey),
        Dispatch::new(&k::SKIN_STORE_REFERENCE, per_sphere, GpuPhase::Survey),
    ];
    if columns {
        before.insert(0, interleave(spheres));
    }
    let test = |part: u32| Dispatch {
        args_index: part,
        first_group: part * per_dispatch,
        ..Dispatch::indirect(&k::CANDIDATES_TEST, GpuPhase::Search)
    };
    let mut after = vec![Dispatch::new(&k::CANDIDATES_TEST_DISPATCH_ARGS, 1, GpuPhase::Search)];
    after.extend((0..parts).map(test));
    after.push(Dispatch::new(&k::OUTCOME_FINISH, 1, GpuPhase::Search));
    [before, after]
}
