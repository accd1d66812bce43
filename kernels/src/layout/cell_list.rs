use bytemuck::{Pod, Zeroable};
use encase::ShaderType;
use glam::{UVec3, Vec3};

/// All zeros mean no sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct InputStats {
    /// Complement of the lowest coordinate, in an order-preserving encoding.
    pub low: [u32; 3],
    /// Highest coordinate per axis, in this encoding.
    pub high: [u32; 3],
    /// Complement of the bits of the smallest effective radius.
    pub smallest: u32,
    pub quarantined: u32,
    /// Spheres per size class (exponent of the effective radius), side after side.
    pub members: [u32; 256 * CellListLayout::MAX_SIDES],
    /// Bits of the largest radius per class.
    pub largest: [u32; 256],
}

#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SpeciesParams {
    /// [`TOUCHES`](Self::TOUCHES), [`IDLE`](Self::IDLE), and at or above bit `SIDE_SHIFT` the side of a cell list.
    pub flags: u32,
    /// Half the largest interaction distance.
    pub half: f32,
}

impl SpeciesParams {
    /// Contact decides some pairs of the species.
    pub const TOUCHES: u32 = 1;
    /// The species never pairs.
    pub const IDLE: u32 = 2;
    /// Lowest bit of the side.
    pub const SIDE_SHIFT: u32 = 8;
}

#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType, Zeroable)]
#[repr(C)]
pub struct CellListLevel {
    /// Cells of the table along each axis. The table repeats in space.
    pub cells: UVec3,
    pub base: u32,
    /// First cell of an unbounded axis.
    pub low: UVec3,
    /// Fixed-point units, a power of two.
    pub units_per_length: f32,
    pub cells_per_length: Vec3,
    /// Bits of the coordinate at or above which neighboring floats are more than a cell apart; infinity if none is.
    pub far: u32,
    /// Cells around each periodic axis, a multiple of `cells`.
    pub around: UVec3,
    pub max_radius: f32,
    /// Levels that spheres of this level search, one bit each.
    pub searched_levels: u32,
    pub searches_itself: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, ShaderType, Zeroable)]
#[repr(C)]
pub struct CellListLayout {
    pub spheres: u32,
    pub cells: u32,
    /// Fixed-point units per cell.
    pub units_per_cell: u32,
    /// Levels with cells, one bit each.
    pub levels: u32,
    /// 1 if smaller spheres leave overfull cells of the first level.
    pub has_overfull_cells: u32,
    /// 1 if no distance test can overflow or underflow.
    pub ordinary: u32,
    /// Levels of the size classes, four per word.
    pub class_levels: [u32; 64],
    pub level: [CellListLevel; CellListLayout::LEVELS],
}

impl CellListLayout {
    /// Maximum levels of all sides together.
    pub const LEVELS: usize = 32;
    /// Cells of depth `k` are 2⁻ᵏ times as large as cells of depth 0.
    pub const DEPTHS: usize = 16;
    /// Pairs of sides decide whether spheres are compared.
    pub const MAX_SIDES: usize = 8;

    pub const fn levels_per_side(sides: usize) -> usize {
        let most = Self::LEVELS / sides;
        if most < Self::DEPTHS { most } else { Self::DEPTHS }
    }
}
