//! The buffers and dispatches of a candidate list, besides those of the search that builds it.

use lazygrid_kernels::kernel as k;
use lazygrid_kernels::layout::{Outcome, SkinState};

use super::buffers::{Slot, bytes_of};
use super::stages::{Phase, Stage};

/// The state of candidates, which is new whenever they are.
pub(in crate::gpu) const STATE: (Slot, u64) = (Slot::SkinState, size_of::<SkinState>() as u64);

/// The buffers for these numbers of spheres and pairs.
pub(in crate::gpu) fn buffers(spheres: u32, pairs: u32, species: bool) -> Vec<(Slot, u64)> {
    let mut buffers = vec![
        (Slot::Kept, bytes_of(spheres, 16)),
        (Slot::Dispatch, 16),
        (Slot::Outcome, size_of::<Outcome>() as u64),
        (Slot::Pairs, bytes_of(pairs, 8)),
    ];
    if species {
        buffers.push((Slot::KeptSpecies, bytes_of(spheres, 4)));
    }
    buffers
}

/// The dispatches before the search for candidates and behind it.
pub(in crate::gpu) fn stages(spheres: u32) -> [Vec<Stage>; 2] {
    let per_sphere = spheres.div_ceil(k::GROUP);
    let before = vec![
        Stage::new(&k::SKIN_MEASURE, per_sphere, Phase::Survey),
        Stage::new(&k::SKIN_DECIDE, 1, Phase::Survey),
        Stage::new(&k::SKIN_KEEP, per_sphere, Phase::Survey),
    ];
    let behind = vec![
        Stage::new(&k::CANDIDATES_OPEN, 1, Phase::Search),
        Stage::indirect(&k::CANDIDATES_TEST, Phase::Search),
        Stage::new(&k::OUTCOME_FINISH, 1, Phase::Search),
    ];
    [before, behind]
}
