// Workgroups of one dimension.
const MAX_GROUPS: u32 = 65535u;

// Tiles that one workgroup of the crowded search compares with, where this many blocks have up to this many tiles:
// few, so that all the device has work, but so many that the shares of a block fit one dimension, and never more than
// an invocation has turns for; the plan has no more entries than that allows.
fn tiles_per_workgroup(blocks: u32, tiles: u32) -> u32 {
    let fewest = max((tiles + MAX_GROUPS - 1u) / MAX_GROUPS, 2u);
    return clamp(min(blocks, MAX_GROUPS) * min(tiles, MAX_GROUPS) / 16384u, fewest, #{RUN_TILES}u);
}
