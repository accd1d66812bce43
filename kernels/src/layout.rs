//! Rust counterparts of shader structures; a test compares sizes and offsets. Structures with vectors have WGSL's
//! layout (`ShaderType`); `repr(C)` keeps the order of members. Other structures consist of words (`Pod`).

use bytemuck::{Pod, Zeroable};
use encase::ShaderType;
use glam::{IVec3, UVec3, Vec3};

use crate::Space;

mod cell_list;
mod columns;

pub use cell_list::{CellListLayout, CellListLevel, InputStats, SpeciesParams};
pub use columns::ColumnLayout;

/// The first word is the number of spheres, so the buffer also serves as `count_source`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SearchParams {
    /// Number of spheres, or its maximum if a buffer holds it.
    pub spheres: u32,
    pub pair_capacity: u32,
    pub entry_capacity: u32,
    /// Bits of a cell's key.
    pub key_bits: u32,
    /// Cell size as a multiple of the largest diameter.
    pub cell_ratio: f32,
    /// Species of the interaction table; 0 without one.
    pub species: u32,
    /// Workgroups of the naive search.
    pub search_groups: u32,
    pub consumer_workgroup_size: u32,
    /// Start of the window: only pairs with a smaller index in `window_begin..window_end` are counted and written, to
    /// fetch large results in parts.
    pub window_begin: u32,
    pub window_end: u32,
    /// Cells that pass smaller spheres to the next level: 0 none, 1 all, 2 with more than `tau`.
    pub split_policy: u32,
    /// Maximum smaller spheres of an unsplit cell.
    pub tau: u32,
    /// Counters in either half of the occupancy table, a power of two.
    pub occupancy_slots: u32,
    /// Maximum tiles of deferred blocks per submission, unless a single block has more; [`Self::UNLIMITED`] without a
    /// limit.
    pub tiles_per_submission: u32,
    /// Length of a periodic x axis, else 0.
    pub period_x: f32,
    pub period_y: f32,
    pub period_z: f32,
    /// Capacity of a cell list's table in cells.
    pub cells: u32,
    /// Counters of the table, a few more than cells; 0 for a radix sort.
    pub counters: u32,
    /// First index of the second set, if only pairs across the sets are found; 0 for one set.
    pub second_set_start: u32,
    /// Keys per tile of a radix sort of a cell list; 0 for a counting sort.
    pub radix_tile: u32,
    /// Candidates of a sphere that one invocation tests.
    pub candidates_per_invocation: u32,
    /// For few spheres, workgroups of the search per block, one per chunk of candidates; else 0: the first search
    /// defers blocks with more than one chunk.
    pub chunks_per_block: u32,
    /// 1 if pairs of a cell list hold positions in cell order.
    pub pairs_in_cell_order: u32,
    /// Sides of a cell list, at most [`CellListLayout::MAX_SIDES`]; see [`Self::with_sides`].
    pub sides: u32,
    pub levels_per_side: u32,
    /// Sides that sides 0 to 3 are compared with: eight bits per side.
    pub partners_low: u32,
    /// Eight bits for each of the sides 4 to 7.
    pub partners_high: u32,
    /// Sides whose effective radii suffice among their own spheres only, one bit each. With spheres of other sides
    /// they pair within twice the larger effective radius.
    pub narrow_sides: u32,
    /// Common interaction of all spheres of compared sides: a distance or [`Self::TOUCH`]; else [`Self::BY_SPECIES`].
    pub interaction: f32,
    /// First workgroup of the dispatch.
    pub first_workgroup: u32,
    /// Maximum workgroups per dispatch of candidate tests; 0 without a limit.
    pub workgroups_per_dispatch: u32,
    /// Always 0, which shader compilers do not know. It guards expressions whose order of evaluation matters.
    pub opaque_zero: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct RadixPass {
    pub shift: u32,
    pub mask: u32,
    /// 1 if the payload is the index of each key, and is not read.
    pub is_first: u32,
}

impl SearchParams {
    /// Value of [`tiles_per_submission`](Self::tiles_per_submission) without a limit.
    pub const UNLIMITED: u32 = u32::MAX;

    /// Interaction of species that never pair.
    pub const NEVER: f32 = -1.0;
    /// Interaction of spheres that pair if they touch.
    pub const TOUCH: f32 = -2.0;
    /// The interaction table decides per pair of species.
    pub const BY_SPECIES: f32 = -3.0;

    /// Returns these parameters with one side per element of `partners`, which has one bit for each side that it is
    /// compared with.
    pub fn with_sides(self, partners: &[u8]) -> Self {
        let word = |first: usize| {
            let bytes = partners.iter().skip(first).take(4).enumerate();
            bytes.fold(0, |word, (side, &partners)| word | u32::from(partners) << (8 * side))
        };
        let levels_per_side = CellListLayout::levels_per_side(partners.len());
        Self {
            sides: partners.len() as u32,
            levels_per_side: levels_per_side as u32,
            partners_low: word(0),
            partners_high: word(4),
            ..self
        }
    }

    pub fn in_space(self, space: Space) -> Self {
        let [period_x, period_y, period_z] = space.lengths_f32().map(|length| length.unwrap_or(0.0));
        Self { period_x, period_y, period_z, ..self }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Bounds {
    /// Lowest corner of all boxes, in an order-preserving encoding.
    pub low: [u32; 3],
    pub high: [u32; 3],
    /// Bits of the smallest effective radius.
    pub radius_min: u32,
    pub radius_max: u32,
    /// Depths that occur, one bit each.
    pub depth_mask: u32,
    /// Spheres per depth that continue below the first level.
    pub descending: [u32; 32],
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ShaderType, Zeroable)]
#[repr(C)]
pub struct LevelKeys {
    /// Bits of each coordinate, which is reduced modulo 2ᵇⁱᵗˢ.
    pub bits: UVec3,
    /// First key of the level.
    pub base: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType, Zeroable)]
#[repr(C)]
pub struct Grid {
    /// A common corner of cells of all levels.
    pub origin: Vec3,
    pub spheres: u32,
    /// Cells of depth 0 per unit of length.
    pub inverse_edge: Vec3,
    /// 1 if no distance test can overflow or underflow.
    pub ordinary: u32,
    pub low: IVec3,
    /// Policy of the parameters; 0 if one level suffices.
    pub split_policy: u32,
    pub high: IVec3,
    /// Depths that are levels, one bit each.
    pub level_mask: u32,
    /// Cells of depth 0 around each periodic axis: a multiple of 4, or a power of two below it; 0 for an unbounded one.
    pub ring_cells: Vec3,
    /// Depths with spheres, one bit each.
    pub depth_mask: u32,
    /// Key bit of passive entries, or 0.
    pub passive: u32,
    pub levels: [LevelKeys; 32],
}

/// The result except the pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
#[non_exhaustive]
pub struct Outcome {
    pub found_lo: u32,
    pub found_hi: u32,
    /// Bits [`Self::OVERFLOW_PAIRS`] to [`Self::OVERFLOW_LAYOUT`].
    pub overflow: u32,
    /// Number of invalid spheres (non-finite value, negative radius or unknown species), which never pair.
    pub quarantined: u32,
    /// Workgroups of a consumer with one thread per written pair.
    pub dispatch_x: u32,
    /// Above 1 for more than 65,535 workgroups.
    pub dispatch_y: u32,
    pub dispatch_z: u32,
    pub deferred_blocks: u32,
    pub entries_lo: u32,
    pub entries_hi: u32,
    pub spheres: u32,
    /// Maximum tiles of a deferred block.
    pub deferred_max_tiles: u32,
    /// First deferred block of the last submission.
    pub deferred_begin: u32,
    pub deferred_end: u32,
    /// Number of spheres in the fullest cell of a cell list that smaller spheres left, or would have left; 0 without
    /// such a cell.
    pub max_occupancy: u32,
    /// 1 if pairs hold positions in cell order (`GpuConfig::pairs_in_cell_order`), 0 for input indices.
    pub pairs_in_cell_order: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SkinParams {
    /// Added to radii.
    pub half_skin: f32,
    /// Squared displacement limit, a little less than half the skin.
    pub limit_squared: f32,
    pub candidate_capacity: u32,
}

/// Kept on the device between calls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
#[non_exhaustive]
pub struct SkinState {
    /// Bits of the largest squared displacement since the list was built; 0 between calls.
    pub displacement: u32,
    /// 1 if a radius, a species or the validity of a sphere changed; 0 between calls.
    pub input_changed: u32,
    /// 1 if the list holds all candidates.
    pub is_complete: u32,
    pub spheres: u32,
    /// Reason for the last call's rebuild: [`NO_LIST`](Self::NO_LIST), [`INPUT_CHANGED`](Self::INPUT_CHANGED) or
    /// [`DISPLACEMENT`](Self::DISPLACEMENT); 0 without one.
    pub rebuild_reason: u32,
    pub age: u32,
    pub candidates: u32,
    /// Bits of the largest squared displacement at the last call.
    pub last_displacement: u32,
}

impl SkinState {
    /// No complete list existed.
    pub const NO_LIST: u32 = 1;
    /// The number, a radius, a species or the validity of spheres changed.
    pub const INPUT_CHANGED: u32 = 2;
    pub const DISPLACEMENT: u32 = 3;
}

impl Outcome {
    /// More pairs than the output holds. The count is exact.
    pub const OVERFLOW_PAIRS: u32 = 1;
    /// More entries than planned. The number of pairs is a lower bound, the number of entries exact. The
    /// caller must raise the capacity and retry.
    pub const OVERFLOW_ENTRIES: u32 = 2;
    /// More spheres than the maximum; the rest was ignored.
    pub const OVERFLOW_SPHERES: u32 = 4;
    /// More candidates than the buffer holds. The number of pairs is a lower bound,
    /// [`candidates_needed`](Self::candidates_needed) exact. The caller must raise the capacity and retry.
    pub const OVERFLOW_CANDIDATES: u32 = 8;
    /// The search [has remaining work](Self::has_remaining_work); the number of pairs is a lower bound.
    pub const OVERFLOW_WORK: u32 = 16;
    /// The cells of an earlier call do not suit the spheres, so pairs are missing. Only calls of a
    /// `GpuSession` reuse cells; it retries.
    pub const OVERFLOW_LAYOUT: u32 = 32;
    /// Bytes before the indirect dispatch arguments.
    pub const DISPATCH_OFFSET: u64 = std::mem::offset_of!(Self, dispatch_x) as u64;

    /// Returns `true` if deferred blocks remain. Until further submissions have searched them, pairs are missing.
    pub fn has_remaining_work(&self) -> bool {
        self.deferred_end < self.deferred_blocks
    }

    /// Returns the number of pairs, written or not.
    pub fn found(&self) -> u64 {
        u64::from(self.found_hi) << 32 | u64::from(self.found_lo)
    }

    /// Returns the number of entries that the grid needs, written or not.
    pub fn entries_needed(&self) -> u64 {
        u64::from(self.entries_hi) << 32 | u64::from(self.entries_lo)
    }

    /// Returns the number of candidates that the skin needs, written or not.
    pub fn candidates_needed(&self) -> u64 {
        self.entries_needed()
    }
}

/// The number of keys of a sort, and of counters to scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct SortCounts {
    pub items: u32,
    pub counters: u32,
}
