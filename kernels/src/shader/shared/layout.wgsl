struct SearchParams {
    spheres: u32,
    pair_capacity: u32,
    entry_capacity: u32,
    key_bits: u32,
    cell_ratio: f32,
    species: u32,
    search_groups: u32,
    consumer_workgroup_size: u32,
    window_begin: u32,
    window_end: u32,
    split_policy: u32,
    tau: u32,
    occupancy_slots: u32,
    tiles_per_submission: u32,
    period_x: f32,
    period_y: f32,
    period_z: f32,
    cells: u32,
    counters: u32,
    second_set_start: u32,
    radix_tile: u32,
    candidates_per_invocation: u32,
    chunks_per_block: u32,
    pairs_in_cell_order: u32,
    sides: u32,
    levels_per_side: u32,
    partners_low: u32,
    partners_high: u32,
    narrow_sides: u32,
    interaction: f32,
    first_workgroup: u32,
    workgroups_per_dispatch: u32,
    opaque_zero: u32,
}

const NEVER: f32 = -1.0;
const TOUCH: f32 = -2.0;
const BY_SPECIES: f32 = -3.0;

struct Bounds {
    low_x: atomic<u32>,
    low_y: atomic<u32>,
    low_z: atomic<u32>,
    high_x: atomic<u32>,
    high_y: atomic<u32>,
    high_z: atomic<u32>,
    radius_min: atomic<u32>,
    radius_max: atomic<u32>,
    depth_mask: atomic<u32>,
    descending: array<atomic<u32>, 32>,
}

struct LevelKeys {
    bits: vec3<u32>,
    base: u32,
}

// cell = floor((position - origin) * inverse_edge * 2^k) at depth k, with cells of depth 0 limited to low..=high.
struct Grid {
    origin: vec3<f32>,
    spheres: u32,
    inverse_edge: vec3<f32>,
    ordinary: u32,
    low: vec3<i32>,
    split_policy: u32,
    high: vec3<i32>,
    level_mask: u32,
    ring_cells: vec3<f32>,
    depth_mask: u32,
    passive: u32,
    levels: array<LevelKeys, 32>,
}

struct Outcome {
    found_lo: atomic<u32>,
    found_hi: atomic<u32>,
    overflow: atomic<u32>,
    quarantined: atomic<u32>,
    dispatch_x: atomic<u32>,
    dispatch_y: atomic<u32>,
    dispatch_z: atomic<u32>,
    deferred_blocks: atomic<u32>,
    entries_lo: atomic<u32>,
    entries_hi: atomic<u32>,
    spheres: atomic<u32>,
    deferred_max_tiles: atomic<u32>,
    deferred_begin: atomic<u32>,
    deferred_end: atomic<u32>,
    max_occupancy: atomic<u32>,
    pairs_in_cell_order: atomic<u32>,
}

struct SortCounts {
    items: u32,
    counters: u32,
}
