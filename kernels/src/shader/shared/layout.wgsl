// The parameters of one call. Word 0 is the number of spheres, so that the same buffer can be bound as
// `count_source` when the host knows the number.
struct SearchParams {
    // The number of spheres, or the most there may be when the number comes from a buffer.
    spheres: u32,
    // Pairs that the output buffer holds.
    pair_capacity: u32,
    // (cell, object) entries that the entry buffers hold.
    entry_capacity: u32,
    // Bits of a cell's key: the grid is folded into that many.
    key_bits: u32,
    // Cell edge as a multiple of the largest diameter.
    cell_ratio: f32,
    // Species of the interaction table; 0 without one.
    species: u32,
    // Workgroups of the naive search.
    search_groups: u32,
    // Threads per workgroup of the consumer of the pairs by indirect dispatch.
    consumer_workgroup_size: u32,
    // Only pairs whose smaller index is in window_begin..window_end are counted and written, so that a result
    // larger than the output can be taken in parts.
    window_begin: u32,
    window_end: u32,
    // The cells that hand their smaller spheres down to the next level: 0 none, 1 all, 2 those with more than `tau`.
    split_policy: u32,
    tau: u32,
    // Counters in either half of the density table, a power of two.
    occupancy_slots: u32,
    // Tiles of entries that the crowded search compares in one part of a call, unless a single block has more;
    // 0xffffffff where it is to be done in one.
    tiles_per_submission: u32,
    // Length of each axis that is periodic, else 0.
    period_x: f32,
    period_y: f32,
    period_z: f32,
    // Cells that the table of a cell list has room for, and counters in that table: two more.
    cells: u32,
    counters: u32,
    // Only pairs of one sphere with an index below this and one with an index from it on are found; 0 finds all.
    second_set_start: u32,
    // Keys of a tile where a cell list is sorted by radix; 0 where it is sorted by counting.
    radix_tile: u32,
    // Candidates of one sphere of a cell list that one invocation tests.
    candidates_per_invocation: u32,
    // Workgroups for further shares of each block of a cell list; 0 where the device finds how many it takes.
    overflow_workgroups: u32,
    // 1 where pairs of a cell list are to name places in the order of the cells.
    pairs_in_cell_order: u32,
    // The sides of a cell list that are compared: bit 0 for spheres of the first with each other, bit 1 for those of the
    // first with those of the second, bit 2 for those of the second with each other.
    side_pairs: u32,
    // The interaction of all spheres of sides that meet, if it is the same for all: a distance, or TOUCH; else BY_SPECIES.
    interaction: f32,
}

// Marks of interactions that are no distances.
const NEVER: f32 = -1.0;
const TOUCH: f32 = -2.0;
const BY_SPECIES: f32 = -3.0;

// The statistics of the spheres. Bounds of all valid ones, their widened radii included; floats in an order-preserving
// encoding.
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
    // Depths that occur, a bit each.
    depth_mask: atomic<u32>,
    // The number of spheres of each depth that go on below the first level.
    descending: array<atomic<u32>, 32>,
}

// The share of the keys that belongs to the cells of one depth.
struct LevelKeys {
    // Key bits of each axis; the coordinate is folded into them.
    bits: vec3<u32>,
    // The first key.
    base: u32,
}

// The grids: cells of depth k have edges of 2^-k of the first ones,
// cell = floor((position - origin) * inverse_edge * 2^k), with cells of depth 0 limited to low..=high.
struct Grid {
    origin: vec3<f32>,
    // The number of spheres of this call.
    spheres: u32,
    // 0 puts everything into one cell.
    inverse_edge: vec3<f32>,
    // 1 when no distance test of this call can overflow or underflow.
    ordinary: u32,
    low: vec3<i32>,
    // As in the call; 0 where all spheres turned out to be of depth 0, or no cell to be dense.
    split_policy: u32,
    high: vec3<i32>,
    // Depths that are levels, a bit each; the first always is.
    level_mask: u32,
    // Edges of depth 0 once around a periodic axis: a multiple of 4, or a power of two below it; 0 for an unbounded
    // axis.
    ring_cells: vec3<f32>,
    // Depths that have spheres.
    depth_mask: u32,
    // The key bit that marks passive entries: 1, or 0 if there is but one level.
    passive: u32,
    levels: array<LevelKeys, 32>,
}

// The result besides the pairs. The dispatch arguments lie so that `dispatch_workgroups_indirect` can read them.
struct Outcome {
    found_lo: atomic<u32>,
    found_hi: atomic<u32>,
    // Bit 0: more pairs than the buffer holds; bit 1: more entries; bit 2: more spheres than prepared for.
    overflow: atomic<u32>,
    quarantined: atomic<u32>,
    dispatch_x: atomic<u32>,
    dispatch_y: atomic<u32>,
    dispatch_z: atomic<u32>,
    // Blocks of entries that have partners too far along the run for the near search.
    deferred_blocks: atomic<u32>,
    entries_lo: atomic<u32>,
    entries_hi: atomic<u32>,
    spheres: atomic<u32>,
    // The most tiles that one of those blocks is compared with.
    deferred_max_tiles: atomic<u32>,
    // The blocks that the present part of the crowded search takes.
    deferred_begin: atomic<u32>,
    deferred_end: atomic<u32>,
    // Spheres in the fullest cell that smaller ones had to leave, or would have; 0 where there was none.
    max_occupancy: atomic<u32>,
    // 1 where pairs name places in the order of the cells, 0 where they name the spheres as given.
    pairs_in_cell_order: atomic<u32>,
}

// The number of keys to sort and of values to scan.
struct SortCounts {
    items: u32,
    counters: u32,
}
