// Opens the next part of the search of further shares: as many of the listed blocks as one part may have, all where no
// parts are asked for, and how many workgroups they need: in x the shares of the sphere with the most candidates, in y
// and z the blocks.
#include layout

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read_write> outcome: Outcome;
@group(0) @binding(2) var<storage, read_write> dispatch: array<u32>;

const UNPARTED: u32 = #{UNPARTED}u;
// Workgroups of one dimension.
const MAX_GROUPS: u32 = 65535u;

@compute @workgroup_size(1)
fn shares_open() {
    let begin = atomicLoad(&outcome.crowded_end);
    let shares = atomicLoad(&outcome.crowded_tiles);
    let left = atomicLoad(&outcome.crowded) - begin;
    let fitting = max(call.part_tiles / (max(shares, 1u) * (call.share / 256u)), 1u);
    let blocks = select(min(left, fitting), left, call.part_tiles == UNPARTED);
    atomicStore(&outcome.crowded_begin, begin);
    atomicStore(&outcome.crowded_end, begin + blocks);
    dispatch[0] = shares;
    dispatch[1] = min(blocks, MAX_GROUPS);
    dispatch[2] = (blocks + MAX_GROUPS - 1u) / MAX_GROUPS;
}
