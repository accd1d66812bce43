#include layout
#include skin

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<uniform> skin: SkinParams;
@group(0) @binding(2) var<storage, read> count_source: array<u32>;
@group(0) @binding(3) var<storage, read_write> found: Outcome;
@group(0) @binding(4) var<storage, read_write> state: SkinState;
@group(0) @binding(5) var<storage, read_write> outcome: Outcome;
@group(0) @binding(6) var<storage, read_write> dispatch: array<u32>;
#include outcome_begin
#include dispatch_2d

const SPHERES: u32 = 4u;
const CANDIDATES: u32 = 8u;
const WORK: u32 = 16u;

@compute @workgroup_size(1)
fn candidates_test_dispatch_args() {
    let count = atomicLoad(&found.found_lo);
    let full = atomicLoad(&found.found_hi) != 0u || count > skin.candidate_capacity;
    // An overflow of pairs in the search for candidates is an overflow of candidates.
    let others = atomicLoad(&found.overflow) & ~(1u | SPHERES);
    let overflow = others | select(0u, CANDIDATES, full);
    let written = select(count, skin.candidate_capacity, full);
    state.is_complete = select(1u, 0u, overflow != 0u);
    state.candidates = written;
    var left = (written + 255u) / 256u;
    let parts = max(arrayLength(&dispatch) / 3u, 1u);
    for (var part = 0u; part < parts; part++) {
        // The plan limits a part to one row of workgroups.
        let taken = select(min(left, params.workgroups_per_dispatch), left, params.workgroups_per_dispatch == 0u);
        let groups = workgroups_2d(taken);
        dispatch[3u * part] = groups.x;
        dispatch[3u * part + 1u] = groups.y;
        dispatch[3u * part + 2u] = 1u;
        left -= taken;
    }
    outcome_begin(overflow, atomicLoad(&found.quarantined));
    // All candidates, for the caller's allocation.
    atomicStore(&outcome.entries_lo, count);
    atomicStore(&outcome.entries_hi, atomicLoad(&found.found_hi));
    atomicStore(&outcome.max_occupancy, 0u);
    if ((overflow & WORK) != 0u) {
        // The caller records enough parts for the unfinished search.
        atomicStore(&outcome.deferred_blocks, atomicLoad(&found.deferred_blocks));
        atomicStore(&outcome.deferred_max_tiles, atomicLoad(&found.deferred_max_tiles));
    }
}
