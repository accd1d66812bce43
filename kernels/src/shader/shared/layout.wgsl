// The parameters of one search. Word 0 is the number of spheres, so that the same buffer can be bound as `count_source`.
struct SearchParams {
    // The number of spheres, or its maximum if a buffer holds the number.
    spheres: u32,
    // The number of pairs that the output buffer holds.
    pair_capacity: u32,
    // The number of (cell, object) entries that the entry buffers hold.
    entry_capacity: u32,
    // The bits of a cell's key.
    key_bits: u32,
    // Cell size as a multiple of the largest diameter.
    cell_ratio: f32,
    // The number of species of the interaction table; 0 without one.
    species: u32,
    // The number of workgroups of the naive search.
    search_groups: u32,
    // Threads per workgroup of the consumer of the pairs by indirect dispatch.
    consumer_workgroup_size: u32,
    // Only pairs whose smaller index is in `window_begin..window_end` are counted and written, so that a result larger than
    // the output can be fetched in windows.
    window_begin: u32,
    window_end: u32,
    // The cells that pass their smaller spheres to the next level: 0 none, 1 all, 2 those with more than `tau`.
    split_policy: u32,
    tau: u32,
    // The number of counters in either half of the occupancy table, a power of two.
    occupancy_slots: u32,
    // The tiles of deferred blocks that one submission compares, unless a single block has more; 0xffffffff without a limit.
    tiles_per_submission: u32,
    // The length of each periodic axis; 0 for an unbounded one.
    period_x: f32,
    period_y: f32,
    period_z: f32,
    // The number of cells that the table of a cell list holds, and its number of counters: two more.
    cells: u32,
    counters: u32,
    // The first index of the second set: only pairs across the two sets are found. 0 for one set.
    second_set_start: u32,
    // Keys per tile if a cell list is sorted by radix; 0 if it is sorted by counting.
    radix_tile: u32,
    // The candidates of one sphere of a cell list that one invocation tests.
    candidates_per_invocation: u32,
    // The workgroups for the later candidates of each block of a cell list; 0 if the device computes the number.
    overflow_workgroups: u32,
    // 1 if pairs of a cell list hold positions in cell order.
    pairs_in_cell_order: u32,
    // The sides of a cell list that are compared: bit 0 for the first side with itself, bit 1 for the first with the second,
    // bit 2 for the second with itself.
    side_pairs: u32,
    // The interaction of all spheres of compared sides, if it is the same for all: a distance, or TOUCH; else BY_SPECIES.
    interaction: f32,
    // The number of the first workgroup of a dispatch that takes a part of a kernel's workgroups.
    first_workgroup: u32,
    // The most workgroups of each dispatch that tests candidates; 0 without a limit.
    workgroups_per_dispatch: u32,
    // Always 0, which compilers cannot know; see `evaluation_order`.
    opaque_zero: u32,
}

// Values of interactions that are not distances.
const NEVER: f32 = -1.0;
const TOUCH: f32 = -2.0;
const BY_SPECIES: f32 = -3.0;

// Statistics of the spheres: the bounds of all valid ones, with their widened radii, in an order-preserving encoding.
struct Bounds {
    low_x: atomic<u32>,
    low_y: atomic<u32>,
    low_z: atomic<u32>,
    high_x: atomic<u32>,
    high_y: atomic<u32>,
    high_z: atomic<u32>,
    // Bits of the smallest and largest effective radius.
    radius_min: atomic<u32>,
    radius_max: atomic<u32>,
    // The depths that occur, one bit each.
    depth_mask: atomic<u32>,
    // The number of spheres of each depth that continue below the first level.
    descending: array<atomic<u32>, 32>,
}

// The keys of one depth.
struct LevelKeys {
    // Key bits of each axis; coordinates are reduced modulo 2^bits.
    bits: vec3<u32>,
    // The first key.
    base: u32,
}

// The grids. Cells of depth k are 2^-k of the size of those of depth 0:
// cell = floor((position - origin) * inverse_edge * 2^k), with cells of depth 0 limited to low..=high.
struct Grid {
    origin: vec3<f32>,
    // The number of spheres of this call.
    spheres: u32,
    // 0 puts everything into one cell.
    inverse_edge: vec3<f32>,
    // 1 if no distance test of this call can overflow or underflow.
    ordinary: u32,
    low: vec3<i32>,
    // As in the parameters; 0 if all spheres have depth 0, or no cell is overfull.
    split_policy: u32,
    high: vec3<i32>,
    // The depths that are levels, one bit each; depth 0 always is.
    level_mask: u32,
    // Cells of depth 0 around a periodic axis: a multiple of 4, or a power of two below it; 0 for an unbounded axis.
    ring_cells: vec3<f32>,
    // The depths that have spheres, one bit each.
    depth_mask: u32,
    // The key bit that marks passive entries: 1, or 0 with a single level.
    passive: u32,
    levels: array<LevelKeys, 32>,
}

// The result except the pairs. `dispatch_workgroups_indirect` reads the dispatch arguments from here.
struct Outcome {
    found_lo: atomic<u32>,
    found_hi: atomic<u32>,
    // Bit 0: more pairs than the buffer holds; bit 1: more entries; bit 2: more spheres than prepared for.
    overflow: atomic<u32>,
    quarantined: atomic<u32>,
    dispatch_x: atomic<u32>,
    dispatch_y: atomic<u32>,
    dispatch_z: atomic<u32>,
    // The number of blocks that the first search deferred.
    deferred_blocks: atomic<u32>,
    entries_lo: atomic<u32>,
    entries_hi: atomic<u32>,
    spheres: atomic<u32>,
    // The most tiles that one of those blocks is compared with.
    deferred_max_tiles: atomic<u32>,
    // The range of blocks of the present submission.
    deferred_begin: atomic<u32>,
    deferred_end: atomic<u32>,
    // The spheres in the fullest cell that smaller spheres left, or would have left; 0 without such a cell.
    max_occupancy: atomic<u32>,
    // 1 if pairs hold positions in cell order, 0 if they hold input indices.
    pairs_in_cell_order: atomic<u32>,
}

// The numbers of keys to sort and of values to scan.
struct SortCounts {
    items: u32,
    counters: u32,
}
