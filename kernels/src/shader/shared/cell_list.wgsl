// Each sphere is in the cell of its center, at the level of its size class. Cells of level k are 2^-k of the size of
// level 0. On each axis they form a ring, so spheres may share a cell, which costs tests but no pair.

const LEVELS: u32 = 16u;
// The first side, then the second.
const SIDED_LEVELS: u32 = 32u;
// Exponents of the effective radius.
const CLASSES: u32 = 256u;
// For size classes with so few spheres that these are listed instead of put into cells.
const LISTED: u32 = 255u;

// See layout.rs. All zeros mean no sphere: lower bounds are stored as complements.
struct InputStats {
    low: array<atomic<u32>, 3>,
    high: array<atomic<u32>, 3>,
    smallest: atomic<u32>,
    quarantined: atomic<u32>,
    members: array<atomic<u32>, 512>,
    largest: array<atomic<u32>, 256>,
}

struct CellListLevel {
    // Cells around each axis: 1, or 3 and more. 0 if the level has no spheres.
    cells: vec3<u32>,
    base: u32,
    low: vec3<u32>,
    units_per_length: f32,
    // Per periodic axis; 0 if it has a single cell.
    cells_per_length: vec3<f32>,
    // Bits of the coordinate at or above which neighboring floats are more than a cell apart; infinity if none is.
    far: u32,
    // At most half a cell.
    max_radius: f32,
    // Levels in which spheres search all cells that their boxes overlap, one bit each: coarser ones of the compared
    // sides, and the same level of the other side if that has more spheres.
    searched_levels: u32,
    searches_itself: u32,
}

struct CellListLayout {
    spheres: u32,
    cells: u32,
    // At every level: 64 to 127.
    units_per_cell: u32,
    levels: u32,
    // 1 if smaller spheres leave the cells of level 0 with more than `tau` spheres.
    has_overfull_cells: u32,
    ordinary: u32,
    // Four per word.
    class_levels: array<u32, 64>,
    level: array<CellListLevel, 32>,
}
