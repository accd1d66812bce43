// The cell list: every sphere in the one cell of its center, at the level of its class of sizes. Cells of level k have
// edges of 2^-k of those of level 0; on each axis they go round a ring, so that whatever cannot be told apart there
// shares a cell, which costs tests and no pair.

const LEVELS: u32 = 16u;
// Levels of both sides: those of the second side follow those of the first.
const SIDED_LEVELS: u32 = 32u;
// Classes of sizes: the exponent of the effective radius.
const CLASSES: u32 = 256u;
// Level of the classes that are listed and not put into cells, as they have so few spheres.
const LISTED: u32 = 255u;

// The statistics of the spheres. Zero says nothing yet: lower bounds are kept as complements. Bounds are of the centers of
// valid spheres, floats in an order-preserving encoding.
struct InputStats {
    low: array<atomic<u32>, 3>,
    high: array<atomic<u32>, 3>,
    // Complement of the bits of the smallest effective radius.
    smallest: atomic<u32>,
    quarantined: atomic<u32>,
    // The number of spheres of each side in each class, and the bits of the largest radius of each class.
    members: array<atomic<u32>, 512>,
    largest: array<atomic<u32>, 256>,
}

struct CellListLevel {
    // Cells once around each axis: 1, or 3 and more. 0 where the level has no spheres.
    cells: vec3<u32>,
    // The level's first cell in the table.
    base: u32,
    // The number of the cell in which an unbounded axis begins.
    low: vec3<u32>,
    // Quanta per unit of length, a power of two.
    units_per_length: f32,
    // Cells per unit of length on a periodic axis; 0 where it has a single cell.
    cells_per_length: vec3<f32>,
    // Bits of the coordinate from which on neighboring floats are farther apart than spheres of this level reach; those of
    // infinity where that is nowhere.
    far: u32,
    // The largest radius that is at home here; half an edge or less.
    max_radius: f32,
    // Levels in which spheres of this one look at all cells that their boxes touch, a bit each: coarser ones of the
    // sides that meet this side, and the same level of the other side if that has more spheres.
    searched_levels: u32,
    // 1 if spheres of this level look at others of this level.
    searches_itself: u32,
}

struct CellListLayout {
    // The number of spheres of the call.
    spheres: u32,
    // Cells of all levels. In the table they are followed by one for listed and one for quarantined spheres.
    cells: u32,
    // Quanta per edge, at every level: 64 to 127.
    units_per_cell: u32,
    // Levels of either side that have cells, a bit each; the first always has.
    levels: u32,
    // 1 where smaller spheres leave the cells of level 0 that have more than `tau` of all.
    has_overfull_cells: u32,
    // 1 when no distance test of this call can overflow or underflow.
    ordinary: u32,
    // Levels of the classes, four to a word.
    class_levels: array<u32, 64>,
    level: array<CellListLevel, 32>,
}
