const MAX_GROUPS: u32 = 65535u;

// Few tiles per workgroup occupy the whole device, but a block's workgroups must fit one dimension. Loops keep within
// the limit of iterations.
fn tiles_per_workgroup(blocks: u32, tiles: u32) -> u32 {
    let fewest = max((tiles + MAX_GROUPS - 1u) / MAX_GROUPS, 2u);
    return clamp(min(blocks, MAX_GROUPS) * min(tiles, MAX_GROUPS) / 16384u, fewest, #{RUN_TILES}u);
}
