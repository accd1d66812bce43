/// Threads per workgroup of every kernel with more than one thread.
pub const WORKGROUP_SIZE: u32 = 256;
/// Keys that one workgroup sorts in a radix pass. With twice as many, runs of equal digits would be as long as a cache
/// line, but registers would suffice for only half the workgroups: on an H200, 24 bits of a million keys then took 9 %
/// longer, and 8 bits of ten million keys 37 %.
pub const RADIX_TILE: u32 = WORKGROUP_SIZE * 8;
/// Values that one workgroup of `scan_reduce` and `scan_spread` reads.
pub const SCAN_TILE: u32 = WORKGROUP_SIZE * SCAN_ITEMS;
/// Spheres that one workgroup of `bounds_reduce` reads.
pub const BOUNDS_TILE: u32 = WORKGROUP_SIZE * SPHERES_PER_THREAD;
/// Counters that one workgroup of `occupancy_clear` clears.
pub const OCCUPANCY_TILE: u32 = WORKGROUP_SIZE * SPHERES_PER_THREAD;
pub const DEPTHS: u32 = 32;
pub const DIGIT_BITS: u32 = 8;
/// Maximum objects that entries can refer to: three bits of an entry's word mark the axes on which the object begins.
pub const MAX_ENTRY_OBJECTS: u64 = 1 << 29;
/// Maximum entries per sphere and level: two cells per axis.
pub const MAX_ENTRIES_PER_SPHERE: u64 = 8;

/// Maximum loop iterations per invocation. Lavapipe silently ends loops after 65,535.
pub const MAX_LOOP_ITERATIONS: u32 = 16_000;
/// Iterations of the naive search per tile: one for each of its eight parts, and per part 32 tests and up to 32 pairs.
pub const NAIVE_ITERATIONS_PER_TILE: u32 = 8 * (1 + 32 + 32);
/// Iterations of `runs_search_far` per tile, which also tests the ownership of 32 pairs.
pub const RUN_ITERATIONS_PER_TILE: u32 = 8 * (1 + 32 + 32 + 32);
/// Maximum tiles per workgroup of the naive search.
pub const NAIVE_TILES: u32 = MAX_LOOP_ITERATIONS / NAIVE_ITERATIONS_PER_TILE;
/// Maximum tiles per workgroup of `runs_search_far`, after its search for the end of a run.
pub const RUN_TILES: u32 = (MAX_LOOP_ITERATIONS - u32::BITS) / RUN_ITERATIONS_PER_TILE;

/// Largest distance, in positions, of two entries of a run that `runs_search_near` tests.
pub const NEAR: u32 = 256;

/// Candidates of a sphere of a cell list that one invocation tests.
pub const CANDIDATES_PER_INVOCATION: u32 = 2048;

/// Maximum values that [`SCAN_ONCE`](super::SCAN_ONCE) scans.
pub const SCANNED_AT_ONCE: u32 = 1 << 16;
pub(super) const SCAN_ITEMS: u32 = 8;
pub(super) const SPHERES_PER_THREAD: u32 = 4;
