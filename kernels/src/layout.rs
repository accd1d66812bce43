//! Rust twins of the structures in the shaders. A test holds sizes and offsets against them.
//!
//! Structures with vectors lie in buffers as WGSL says (`ShaderType`). `repr(C)` keeps their members in order, by which the
//! test tells them apart. The others are words alone, which are the same on both sides, and are copied as they are (`Pod`).

use bytemuck::{Pod, Zeroable};
use encase::ShaderType;
use glam::{IVec3, UVec3, Vec3};

use crate::Space;

/// The parameters of one call. The first word is the number of spheres, so that the same buffer can be
/// bound as `count_source`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SearchParams {
    /// The number of spheres, or the most there may be when the number comes from a buffer.
    pub spheres: u32,
    /// Pairs that the output buffer holds.
    pub pair_capacity: u32,
    /// (cell, object) entries that the entry buffers hold.
    pub entry_capacity: u32,
    /// Bits of a cell's key.
    pub key_bits: u32,
    /// Cell edge as a multiple of the largest diameter.
    pub cell_ratio: f32,
    /// Species of the interaction table; 0 without one.
    pub species: u32,
    /// Workgroups of the naive search.
    pub search_groups: u32,
    /// Threads per workgroup of the consumer of the pairs by indirect dispatch.
    pub consumer_workgroup_size: u32,
    /// Only pairs whose smaller index is in `window_begin..window_end` are counted and written, so that a result
    /// larger than the output can be taken in parts.
    pub window_begin: u32,
    /// The end of that window.
    pub window_end: u32,
    /// Which cells hand their smaller spheres down to the next level: 0 none, 1 all, 2 those with more than `tau`.
    pub split_policy: u32,
    /// The most smaller spheres in a cell that is settled by brute force.
    pub tau: u32,
    /// Counters in either half of the density table, a power of two.
    pub occupancy_slots: u32,
    /// Tiles of entries that the crowded search compares in one part of a call, unless a single block has more;
    /// [`SearchParams::UNLIMITED`] where it is to be done in one.
    pub tiles_per_submission: u32,
    /// Length of the axis x where it is periodic, else 0.
    pub period_x: f32,
    /// Length of the axis y where it is periodic, else 0.
    pub period_y: f32,
    /// Length of the axis z where it is periodic, else 0.
    pub period_z: f32,
    /// Cells that the table of a cell list has room for.
    pub cells: u32,
    /// Counters in that table: two more.
    pub counters: u32,
    /// The number of spheres of the first of two sets, which come before those of the second: only pairs of one of each are
    /// found. 0 finds all pairs.
    pub second_set_start: u32,
    /// Keys of a tile where a cell list is sorted by radix; 0 where it is sorted by counting.
    pub radix_tile: u32,
    /// Candidates of one sphere that one invocation tests.
    pub candidates_per_invocation: u32,
    /// Workgroups for further shares of each block; 0 where the device finds how many it takes.
    pub overflow_workgroups: u32,
    /// 1 where pairs of a cell list are to name places in the order of the cells.
    pub pairs_in_cell_order: u32,
    /// The sides of a cell list that are compared: [`SearchParams::FIRST_WITH_ITSELF`], [`SearchParams::FIRST_WITH_SECOND`] and
    /// [`SearchParams::SECOND_WITH_ITSELF`].
    pub side_pairs: u32,
    /// The interaction of all spheres of sides that meet, if it is the same for all: a distance, or [`SearchParams::TOUCH`]; else
    /// [`SearchParams::BY_SPECIES`].
    pub interaction: f32,
}

/// Which digit a radix pass sorts by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct RadixPass {
    /// Its lowest bit.
    pub shift: u32,
    /// The mask of a key after the shift.
    pub mask: u32,
    /// 1 where the payload is the place of each key, and is not read.
    pub is_first: u32,
}

impl SearchParams {
    /// The same as [`tiles_per_submission`](Self::tiles_per_submission): all of the crowded search in one part, however much that is.
    pub const UNLIMITED: u32 = u32::MAX;

    /// Spheres of the first side are compared with each other.
    pub const FIRST_WITH_ITSELF: u32 = 1;
    /// Spheres of the first side are compared with those of the second.
    pub const FIRST_WITH_SECOND: u32 = 2;
    /// Spheres of the second side are compared with each other.
    pub const SECOND_WITH_ITSELF: u32 = 4;
    /// In an interaction table: two species never pair.
    pub const NEVER: f32 = -1.0;
    /// Spheres pair by touching.
    pub const TOUCH: f32 = -2.0;
    /// The interaction table decides for each pair of species.
    pub const BY_SPECIES: f32 = -3.0;

    /// The same call in this space.
    pub fn in_space(self, space: Space) -> Self {
        let [period_x, period_y, period_z] = space.lengths_f32().map(|length| length.unwrap_or(0.0));
        Self { period_x, period_y, period_z, ..self }
    }
}

/// Statistics of the spheres, computed on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Bounds {
    /// The lowest corner of all boxes, as integers in the order of the floats.
    pub low: [u32; 3],
    /// The highest corner, likewise.
    pub high: [u32; 3],
    /// Bits of the smallest effective radius.
    pub radius_min: u32,
    /// Bits of the largest effective radius.
    pub radius_max: u32,
    /// Depths that occur, a bit each.
    pub depth_mask: u32,
    /// The number of spheres of each depth that descend below the first level.
    pub descending: [u32; 32],
}

/// The share of the keys that belongs to the cells of one depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ShaderType, Zeroable)]
#[repr(C)]
pub struct LevelKeys {
    /// Key bits of each axis.
    pub bits: UVec3,
    /// The first key.
    pub base: u32,
}

/// The grids, as the device chooses them.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType, Zeroable)]
#[repr(C)]
pub struct Grid {
    /// A point that is a corner of cells of all levels.
    pub origin: Vec3,
    /// The number of spheres of the call.
    pub spheres: u32,
    /// Cells of depth 0 per unit of length.
    pub inverse_edge: Vec3,
    /// 1 when no distance test of the call can overflow or underflow.
    pub ordinary: u32,
    /// The lowest cell of depth 0.
    pub low: IVec3,
    /// As in the call; 0 where one level turned out to do.
    pub split_policy: u32,
    /// The highest cell of depth 0.
    pub high: IVec3,
    /// Depths that are levels, a bit each.
    pub level_mask: u32,
    /// Edges of depth 0 once around each periodic axis, 0 for an unbounded one.
    pub ring_cells: Vec3,
    /// Depths that have spheres, a bit each.
    pub depth_mask: u32,
    /// The key bit that marks passive entries, or 0.
    pub passive: u32,
    /// Keys of each depth.
    pub levels: [LevelKeys; 32],
}

/// The result besides the pairs, as it lies in the outcome buffer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Outcome {
    /// Low word of the number of pairs found.
    pub found_lo: u32,
    /// High word of the number of pairs found.
    pub found_hi: u32,
    /// Bits [`Outcome::OVERFLOW_PAIRS`], [`Outcome::OVERFLOW_ENTRIES`], [`Outcome::OVERFLOW_SPHERES`] and [`Outcome::OVERFLOW_CANDIDATES`].
    pub overflow: u32,
    /// Spheres that are not finite or have a negative radius (or an unknown species): they pair with nothing.
    pub quarantined: u32,
    /// Workgroups for a consumer with one thread per written pair.
    pub dispatch_x: u32,
    /// Second dimension of that dispatch; above 1 when more than 65 535 workgroups are needed.
    pub dispatch_y: u32,
    /// Third dimension of that dispatch, 1.
    pub dispatch_z: u32,
    /// Blocks of entries that went to the crowded search.
    pub deferred_blocks: u32,
    /// Low word of the number of entries.
    pub entries_lo: u32,
    /// High word of the number of entries.
    pub entries_hi: u32,
    /// Spheres that the call was given.
    pub spheres: u32,
    /// The most tiles of entries that one of those blocks is compared with.
    pub deferred_max_tiles: u32,
    /// The first of those blocks that the last part of the crowded search took.
    pub deferred_begin: u32,
    /// One past the last of them.
    pub deferred_end: u32,
    /// Cell list: spheres in the fullest cell that smaller ones had to leave, or would have; 0 where there was none.
    pub max_occupancy: u32,
    /// 1 where pairs name places in the order of the cells (`GpuConfig::pairs_in_cell_order`), 0 where they name the spheres as
    /// given.
    pub pairs_in_cell_order: u32,
}

/// The parameters of a candidate list that outlives a call.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SkinParams {
    /// Half of the skin, by which radii grow.
    pub half_skin: f32,
    /// The square of how far a sphere may go: a little less than that half.
    pub limit_squared: f32,
    /// Candidates that there is room for.
    pub candidate_capacity: u32,
}

/// The state of the candidate list, kept on the device between calls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct SkinState {
    /// Bits of the square of how far the farthest sphere has gone, as a call measures it; 0 between calls.
    pub displacement: u32,
    /// 1 where some sphere is not the one of then, likewise.
    pub input_changed: u32,
    /// 1 where the candidates are all that there are.
    pub is_complete: u32,
    /// The number of spheres.
    pub spheres: u32,
    /// Why the last call found candidates anew: [`NO_LIST`](Self::NO_LIST), [`INPUT_CHANGED`](Self::INPUT_CHANGED) or
    /// [`DISPLACEMENT`](Self::DISPLACEMENT); 0 where it kept them.
    pub rebuild_reason: u32,
    /// Calls since then.
    pub age: u32,
    /// The number of candidates.
    pub candidates: u32,
    /// Bits of the square of how far the farthest sphere had gone at the last call.
    pub last_displacement: u32,
}

impl SkinState {
    /// There were no candidates, or not all.
    pub const NO_LIST: u32 = 1;
    /// There were more spheres or fewer, others, or of other radii or species.
    pub const INPUT_CHANGED: u32 = 2;
    /// Some sphere had gone too far.
    pub const DISPLACEMENT: u32 = 3;
}

impl Outcome {
    /// Overflow bit: more pairs than the output holds; the count is exact nevertheless.
    pub const OVERFLOW_PAIRS: u32 = 1;
    /// Overflow bit: more entries than planned; the number of pairs is then a lower bound, that of entries is exact,
    /// and the call must be repeated with room for them.
    pub const OVERFLOW_ENTRIES: u32 = 2;
    /// Overflow bit: more spheres than prepared for; those beyond were not looked at.
    pub const OVERFLOW_SPHERES: u32 = 4;
    /// Overflow bit: more candidates than there is room for; the number of pairs is then a lower bound,
    /// [`entries`](Self::entries) is that of the candidates, and the call must be repeated with room for them.
    pub const OVERFLOW_CANDIDATES: u32 = 8;
    /// Offset of the indirect-dispatch arguments in bytes.
    pub const DISPATCH_OFFSET: u64 = std::mem::offset_of!(Self, dispatch_x) as u64;

    /// Returns `true` if the crowded search has a further part to come; until then pairs are missing. Never so after a
    /// call that asked for no parts (see [`SearchParams::UNLIMITED`]), hence not an overflow.
    pub fn has_remaining_work(&self) -> bool {
        self.deferred_end < self.deferred_blocks
    }

    /// How many pairs were found, whether or not they were written.
    pub fn found(&self) -> u64 {
        u64::from(self.found_hi) << 32 | u64::from(self.found_lo)
    }

    /// Returns the number of entries that the grid of the call needs, written or not.
    pub fn entries_needed(&self) -> u64 {
        u64::from(self.entries_hi) << 32 | u64::from(self.entries_lo)
    }

    /// Returns the number of candidate pairs that the skin of the call needs, written or not.
    pub fn candidates_needed(&self) -> u64 {
        self.entries_needed()
    }
}

/// What the spheres of a cell list are like, as the device finds it. Zero says nothing yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct InputStats {
    /// Complements of the lowest centre, as integers in the order of the floats.
    pub low: [u32; 3],
    /// The highest centre, likewise.
    pub high: [u32; 3],
    /// Complement of the bits of the smallest effective radius.
    pub smallest: u32,
    /// Spheres that are not valid.
    pub quarantined: u32,
    /// The number of spheres with each exponent of the effective radius, of the first side and then of the second.
    pub members: [u32; 512],
    /// The bits of the largest radius with each exponent.
    pub largest: [u32; 256],
}

/// The flags and the reach of a species.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SpeciesParams {
    /// [`TOUCHES`](Self::TOUCHES), [`SECOND_SIDE`](Self::SECOND_SIDE) and [`IDLE`](Self::IDLE).
    pub flags: u32,
    /// Half the largest distance at which the species pairs.
    pub half: f32,
}

impl SpeciesParams {
    /// Some pair of the species is decided by touching.
    pub const TOUCHES: u32 = 1;
    /// The spheres of the species are on the second side of a cell list.
    pub const SECOND_SIDE: u32 = 2;
    /// The species pairs with none.
    pub const IDLE: u32 = 4;
}

/// A level of a cell list.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType, Zeroable)]
#[repr(C)]
pub struct CellListLevel {
    /// Cells once around each axis.
    pub cells: UVec3,
    /// The level's first cell in the table.
    pub base: u32,
    /// The number of the cell in which an unbounded axis begins.
    pub low: UVec3,
    /// Quanta per unit of length.
    pub units_per_length: f32,
    /// Cells per unit of length on a periodic axis.
    pub cells_per_length: Vec3,
    /// Bits of the coordinate from which on neighbouring floats are farther apart than spheres of this level reach; those
    /// of infinity where that is nowhere.
    pub far: u32,
    /// The largest radius that is at home here.
    pub max_radius: f32,
    /// Levels in which spheres of this level look at all cells that their boxes touch, a bit each.
    pub searched_levels: u32,
    /// 1 if spheres of this level look at others of this level.
    pub searches_itself: u32,
}

/// The cells of a cell list, as the device chooses them.
#[derive(Clone, Copy, Debug, PartialEq, ShaderType, Zeroable)]
#[repr(C)]
pub struct CellListLayout {
    /// The number of spheres of the call.
    pub spheres: u32,
    /// Cells of all levels.
    pub cells: u32,
    /// Quanta per edge.
    pub units_per_cell: u32,
    /// Levels that have cells, a bit each.
    pub levels: u32,
    /// 1 where smaller spheres leave crowded cells of the first level.
    pub has_overfull_cells: u32,
    /// 1 when no distance test of the call can overflow or underflow.
    pub ordinary: u32,
    /// Levels of the classes, four to a word.
    pub class_levels: [u32; 64],
    /// The levels of the first side, followed by those of the second.
    pub level: [CellListLevel; 2 * CellListLayout::LEVELS],
}

impl CellListLayout {
    /// Levels of each side.
    pub const LEVELS: usize = 16;
}

/// How many keys to sort and how many values to scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct SortCounts {
    /// Keys to sort.
    pub items: u32,
    /// Values to scan.
    pub counters: u32,
}
