// How many workgroups the crowded search needs: in x the shares of the block with the most tiles, in y and z the
// listed blocks.
#include layout

@group(0) @binding(0) var<storage, read_write> outcome: Outcome;
@group(0) @binding(1) var<storage, read_write> dispatch: array<u32>;
#include crowd

@compute @workgroup_size(1)
fn crowded_open() {
    let blocks = atomicLoad(&outcome.crowded);
    let tiles = atomicLoad(&outcome.crowded_tiles);
    let per_share = tiles_per_share(blocks, tiles);
    let layers = (blocks + MAX_GROUPS - 1u) / MAX_GROUPS;
    dispatch[0] = (tiles + per_share - 1u) / per_share;
    dispatch[1] = min(blocks, MAX_GROUPS);
    dispatch[2] = layers;
}
