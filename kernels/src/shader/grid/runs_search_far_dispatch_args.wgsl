// Writes the dispatch arguments of the next submission: x counts the workgroups of the largest block; y and z count
// blocks.
#include layout

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read_write> outcome: Outcome;
@group(0) @binding(2) var<storage, read_write> dispatch: array<u32>;
#include far_tiles

const UNLIMITED: u32 = #{UNLIMITED}u;

@compute @workgroup_size(1)
fn runs_search_far_dispatch_args() {
    let begin = atomicLoad(&outcome.deferred_end);
    let tiles = atomicLoad(&outcome.deferred_max_tiles);
    let left = atomicLoad(&outcome.deferred_blocks) - begin;
    let fitting = max(params.tiles_per_submission / max(tiles, 1u), 1u);
    let blocks = select(min(left, fitting), left, params.tiles_per_submission == UNLIMITED);
    atomicStore(&outcome.deferred_begin, begin);
    atomicStore(&outcome.deferred_end, begin + blocks);
    let per_workgroup = tiles_per_workgroup(blocks, tiles);
    dispatch[0] = (tiles + per_workgroup - 1u) / per_workgroup;
    dispatch[1] = min(blocks, MAX_GROUPS);
    dispatch[2] = (blocks + MAX_GROUPS - 1u) / MAX_GROUPS;
}
