// Opens the next part of the crowded search: as many of the listed blocks as one part may have, all where no parts are
// asked for, and how many workgroups they need: in x the shares of the block with the most tiles, in y and z the blocks.
#include layout

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read_write> outcome: Outcome;
@group(0) @binding(2) var<storage, read_write> dispatch: array<u32>;
#include crowd

const UNPARTED: u32 = #{UNPARTED}u;

@compute @workgroup_size(1)
fn crowded_open() {
    let begin = atomicLoad(&outcome.crowded_end);
    let tiles = atomicLoad(&outcome.crowded_tiles);
    let left = atomicLoad(&outcome.crowded) - begin;
    let fitting = max(call.part_tiles / max(tiles, 1u), 1u);
    let blocks = select(min(left, fitting), left, call.part_tiles == UNPARTED);
    atomicStore(&outcome.crowded_begin, begin);
    atomicStore(&outcome.crowded_end, begin + blocks);
    let per_share = tiles_per_share(blocks, tiles);
    let layers = (blocks + MAX_GROUPS - 1u) / MAX_GROUPS;
    dispatch[0] = (tiles + per_share - 1u) / per_share;
    dispatch[1] = min(blocks, MAX_GROUPS);
    dispatch[2] = layers;
}
