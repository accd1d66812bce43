//! Sizes that shaders and plans share. A test compares them with the shaders.

/// Threads per workgroup of every kernel that has more than one thread.
pub const WORKGROUP_SIZE: u32 = 256;
/// Keys that one workgroup sorts in a radix pass if its memory holds them: runs of equal digits are as long as a cache line.
pub const WIDE_TILE: u32 = WORKGROUP_SIZE * 16;
/// Keys that one workgroup sorts with less memory.
pub const NARROW_TILE: u32 = WORKGROUP_SIZE * 8;
/// Values that one workgroup scans.
pub const SCAN_TILE: u32 = WORKGROUP_SIZE * SCAN_ITEMS;
/// Spheres that one workgroup of `bounds_reduce` reads.
pub const BOUNDS_TILE: u32 = WORKGROUP_SIZE * SPHERES_PER_THREAD;
/// Counters that one workgroup of `occupancy_clear` clears.
pub const DENSITY_TILE: u32 = WORKGROUP_SIZE * SPHERES_PER_THREAD;
/// The number of depths of a grid. Cells at each depth are half as wide as at the one before.
pub const DEPTHS: u32 = 32;
/// Bits of one radix digit.
pub const DIGIT_BITS: u32 = 8;
/// The most objects that an entry can name: three bits of its word say on which axes the object begins.
pub const MAX_ENTRY_OBJECTS: u64 = 1 << 29;
/// The most entries per sphere and level: no sphere overlaps more than two cells per axis.
pub const MAX_ENTRIES_PER_SPHERE: u64 = 8;

/// The most loop iterations of one invocation in all. Lavapipe silently ends loops after 65,535.
pub const MAX_LOOP_ITERATIONS: u32 = 16_000;
/// Iterations of the naive search per tile: for each of its eight parts 32 tests and up to 32 pairs.
pub const NAIVE_ITERATIONS_PER_TILE: u32 = 8 * (1 + 32 + 32);
/// Iterations of `runs_search_far` per tile: also whether the cell owns each of the 32 pairs.
pub const RUN_ITERATIONS_PER_TILE: u32 = 8 * (1 + 32 + 32 + 32);
/// The most tiles that one workgroup of the naive search compares with.
pub const NAIVE_TILES: u32 = MAX_LOOP_ITERATIONS / NAIVE_ITERATIONS_PER_TILE;
/// The most tiles that one workgroup of `runs_search_far` compares with, after it searched for the end of a run.
pub const RUN_TILES: u32 = (MAX_LOOP_ITERATIONS - u32::BITS) / RUN_ITERATIONS_PER_TILE;

/// The most positions between two entries of a run that `runs_search_near` tests.
pub const NEAR: u32 = 256;

/// The candidates of one sphere of a cell list that one invocation tests.
pub const CANDIDATES_PER_INVOCATION: u32 = 2048;

/// The most values that [`SCAN_ONCE`](super::SCAN_ONCE) takes.
pub const SCANNED_AT_ONCE: u32 = 1 << 16;
pub(super) const SCAN_ITEMS: u32 = 8;
pub(super) const SPHERES_PER_THREAD: u32 = 4;
