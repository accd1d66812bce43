// Workgroups of one dimension.
const MAX_GROUPS: u32 = 65535u;

// Tiles that one workgroup of the crowded search compares with, where this many blocks have up to this many tiles:
// few, so that all the device has work, and never more than an invocation has turns for.
fn tiles_per_share(blocks: u32, tiles: u32) -> u32 {
    return clamp(min(blocks, MAX_GROUPS) * min(tiles, MAX_GROUPS) / 16384u, 2u, #{CROWDED_TILES}u);
}
