// Each sphere is in the cell of its center, at the level of its size class. Cells form a ring on each axis, so distant
// spheres may share a cell, which costs tests but no pair.

const LEVELS: u32 = 32u;
const DEPTHS: u32 = 16u;
// Exponents of the effective radius.
const CLASSES: u32 = 256u;
// Level of the largest size classes, whose few spheres have no cells.
const LISTED: u32 = 255u;
// Maximum listed spheres, which are compared with all others.
const MAX_LISTED: u32 = 8u;

// See layout.rs.
struct InputStats {
    low: array<atomic<u32>, 3>,
    high: array<atomic<u32>, 3>,
    smallest: atomic<u32>,
    quarantined: atomic<u32>,
    members: array<atomic<u32>, 2048>,
    largest: array<atomic<u32>, 256>,
}

struct CellListLevel {
    cells: vec3<u32>,
    base: u32,
    low: vec3<u32>,
    units_per_length: f32,
    cells_per_length: vec3<f32>,
    far: u32,
    around: vec3<u32>,
    max_radius: f32,
    searched_levels: u32,
    searches_itself: u32,
}

struct CellListLayout {
    spheres: u32,
    cells: u32,
    units_per_cell: u32,
    levels: u32,
    has_overfull_cells: u32,
    ordinary: u32,
    class_levels: array<u32, 64>,
    level: array<CellListLevel, LEVELS>,
}
