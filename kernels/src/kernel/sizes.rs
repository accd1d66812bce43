//! Sizes that shaders and plans share. A test holds them against the shaders.

/// Threads per workgroup of every kernel that is not a single thread.
pub const WORKGROUP_SIZE: u32 = 256;
/// Keys that one workgroup sorts in a radix pass if there is workgroup memory for them: runs of equal digits are
/// as long as a cache line.
pub const WIDE_TILE: u32 = WORKGROUP_SIZE * 16;
/// Keys that one workgroup sorts elsewhere.
pub const NARROW_TILE: u32 = WORKGROUP_SIZE * 8;
/// Values that one workgroup scans.
pub const SCAN_TILE: u32 = WORKGROUP_SIZE * SCAN_ITEMS;
/// Spheres that one workgroup of `bounds_reduce` reads.
pub const BOUNDS_TILE: u32 = WORKGROUP_SIZE * SPHERES_PER_THREAD;
/// Counters that one workgroup of `occupancy_clear` clears.
pub const DENSITY_TILE: u32 = WORKGROUP_SIZE * SPHERES_PER_THREAD;
/// Depths of a grid, cells at each half as wide as at the one before.
pub const DEPTHS: u32 = 32;
/// Bits of one radix digit.
pub const DIGIT_BITS: u32 = 8;
/// Most objects an entry can name: three bits of its word say where the object begins.
pub const MAX_ENTRY_OBJECTS: u64 = 1 << 29;
/// Most entries per sphere and level: grids are chosen so that no sphere overlaps more than two cells per axis.
pub const MAX_ENTRIES_PER_SPHERE: u64 = 8;

/// Turns that the loops of one invocation may take in all. Lavapipe ends them after 65 535, without a word.
pub const MAX_LOOP_ITERATIONS: u32 = 16_000;
/// Turns of the naive search per tile: of its eight parts each 32 tests and up to 32 pairs.
pub const NAIVE_ITERATIONS_PER_TILE: u32 = 8 * (1 + 32 + 32);
/// Turns of the crowded search per tile: the same, and whether this cell owns each of 32 pairs.
pub const RUN_ITERATIONS_PER_TILE: u32 = 8 * (1 + 32 + 32 + 32);
/// Tiles that one workgroup of the naive search may compare with.
pub const NAIVE_TILES: u32 = MAX_LOOP_ITERATIONS / NAIVE_ITERATIONS_PER_TILE;
/// Tiles that one workgroup of the crowded search may compare with, after looking for the end of a run.
pub const RUN_TILES: u32 = (MAX_LOOP_ITERATIONS - u32::BITS) / RUN_ITERATIONS_PER_TILE;

/// Candidates of one sphere of a cell list that are tested by one invocation.
pub const CANDIDATES_PER_INVOCATION: u32 = 2048;

/// The most values that [`SCAN_ONCE`](super::SCAN_ONCE) takes.
pub const SCANNED_AT_ONCE: u32 = 1 << 16;
pub(super) const SCAN_ITEMS: u32 = 8;
pub(super) const SPHERES_PER_THREAD: u32 = 4;
