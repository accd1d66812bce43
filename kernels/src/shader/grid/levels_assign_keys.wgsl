// Divides the keys among levels in proportion to spheres that may have entries.
#include layout
#include thread

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read_write> bounds: Bounds;
@group(0) @binding(2) var<storage, read_write> grid: Grid;
#include key_hash

const MIN_BITS: u32 = 3u * MIN_AXIS_BITS;

var<workgroup> weights: array<u32, 32>;
var<workgroup> sizes: array<u32, 32>;

@compute @workgroup_size(32)
fn levels_assign_keys(
#include thread_builtins
) {
#include thread_from_builtins
    let depth = thread.local_index;
    let occupied = atomicLoad(&bounds.depth_mask);
    var deeper = 0u;
    var weight = 0u;
    for (var finer = 31u; finer > 0u; finer--) {
        deeper += atomicLoad(&bounds.descending[finer]);
        if (finer == depth) {
            weight = deeper;
        }
    }
    if (depth == 0u) {
        weight = grid.spheres;
    }
    let depths = occupied | 1u;
    let is_level = (depths & (1u << depth)) != 0u;
    weights[depth] = select(0u, weight, is_level);
    workgroupBarrier();
    var total = 0.0;
    for (var other = 0u; other < 32u; other++) {
        total += f32(weights[other]);
    }
    // One bit marks passive entries.
    let keys = 1u << (params.key_bits - 1u);
    let spare = keys - (countOneBits(depths) << MIN_BITS);
    // Rounded down, because shares must not exceed all keys.
    let share = f32(spare) * (f32(weights[depth]) / total) * 0x1.ff8p-1;
    let share_bits = (bitcast<u32>(max(share, 1.0)) >> 23u) - 127u;
    let cells = axis_bits(grid.low, grid.high, grid.ring_cells, depth);
    let bits = hash_bits(cells, max(share_bits, MIN_BITS));
    sizes[depth] = select(0u, 1u << (bits.x + bits.y + bits.z), is_level);
    workgroupBarrier();
    var base = 0u;
    for (var coarser = 0u; coarser < depth; coarser++) {
        base += sizes[coarser];
    }
    workgroupBarrier();
    // Without an overfull cell, all entries stay at the first level.
    if (depth == 0u && deeper == 0u) {
        grid.split_policy = 0u;
    }
    if (deeper == 0u) {
        return;
    }
    grid.levels[depth] = LevelKeys(bits, base);
    if (depth == 0u) {
        grid.level_mask = depths;
        grid.depth_mask = occupied;
        grid.passive = 1u;
    }
}
