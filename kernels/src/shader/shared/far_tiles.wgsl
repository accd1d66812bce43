const MAX_GROUPS: u32 = 65535u;

// Returns the tiles per workgroup of `runs_search_far`, for `blocks` blocks of up to `tiles` tiles: few, to occupy the
// whole device; enough that a block's workgroups fit one dimension; and at most as the limit of loop iterations allows.
fn tiles_per_workgroup(blocks: u32, tiles: u32) -> u32 {
    let fewest = max((tiles + MAX_GROUPS - 1u) / MAX_GROUPS, 2u);
    return clamp(min(blocks, MAX_GROUPS) * min(tiles, MAX_GROUPS) / 16384u, fewest, #{RUN_TILES}u);
}
