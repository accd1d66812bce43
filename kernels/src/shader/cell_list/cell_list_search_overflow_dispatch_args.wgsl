// Writes the dispatch arguments of the next submission: x counts further chunks; y and z count blocks.
#include layout

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read_write> outcome: Outcome;
@group(0) @binding(2) var<storage, read_write> dispatch: array<u32>;

const UNLIMITED: u32 = #{UNLIMITED}u;
const MAX_GROUPS: u32 = 65535u;

@compute @workgroup_size(1)
fn cell_list_search_overflow_dispatch_args() {
    let begin = atomicLoad(&outcome.deferred_end);
    let chunks = atomicLoad(&outcome.deferred_max_tiles);
    let left = atomicLoad(&outcome.deferred_blocks) - begin;
    let fitting = max(params.tiles_per_submission / (max(chunks, 1u) * (params.candidates_per_invocation / 256u)), 1u);
    let blocks = select(min(left, fitting), left, params.tiles_per_submission == UNLIMITED);
    atomicStore(&outcome.deferred_begin, begin);
    atomicStore(&outcome.deferred_end, begin + blocks);
    dispatch[0] = chunks;
    dispatch[1] = min(blocks, MAX_GROUPS);
    dispatch[2] = (blocks + MAX_GROUPS - 1u) / MAX_GROUPS;
}
