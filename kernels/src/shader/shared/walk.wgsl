// A sphere's way through its candidates: rows of cells, each a stretch or two of the sorted spheres, so that every pair
// is met from one of its two spheres and only once.
//
// A sphere in a cell is compared with
// - the later spheres of its own cell, and those of one half of the adjacent cells, if its level meets itself;
// - at each level that its own looks at, the spheres of all cells that its box touches when widened by that level's reach;
// - the listed spheres, which have a cell of their own without adjacent cells.

// Beyond the levels there is nothing.
const NOWHERE: u32 = 256u;

struct Walk {
    // The level it is at; NOWHERE at the end.
    level: u32,
    // Cells of that level around each axis, and its first cell.
    around: vec3<u32>,
    base: u32,
    // The first cell of the box of cells that it goes through there, and how many cells a row has and rows a plane.
    first: vec3<u32>,
    cells_per_row: u32,
    rows_per_plane: u32,
    // The next row and the end of all, counted plane by plane.
    row: u32,
    end: u32,
    // `true` if the next rows are taken from the seam on.
    beyond: bool,
    // Levels that it has still to enter, a bit each.
    levels: u32,
    // Candidates in these rows that are behind it, and those in the rows before.
    taken: u32,
    passed: u32,
}

// The number of rows that are searched at once.
const ROWS_AT_ONCE: u32 = 5u;

// A row of cells.
struct RowOfCells {
    number: u32,
    y: u32,
    z: u32,
    // Rows in its plane before it.
    in_plane: u32,
}

// Candidates of up to five rows of cells, and the listed ones behind the last: of which number on the next stretch begins,
// and what makes a number a place among the sorted spheres.
struct Stretches {
    until: vec4<u32>,
    shift: vec4<u32>,
    last_until: u32,
    last_shifts: vec2<u32>,
    total: u32,
    // `true` if the rows go on beyond the seam.
    wraps: bool,
}

fn candidate_at(stretches: Stretches, number: u32) -> u32 {
    var shift = select(stretches.shift.x, stretches.shift.y, number >= stretches.until.x);
    shift = select(shift, stretches.shift.z, number >= stretches.until.y);
    shift = select(shift, stretches.shift.w, number >= stretches.until.z);
    shift = select(shift, stretches.last_shifts.x, number >= stretches.until.w);
    return number + select(shift, stretches.last_shifts.y, number >= stretches.last_until);
}

fn walk_begin(own: u32) -> Walk {
    let is_listed = own >= list.cells;
    var walk: Walk;
    walk.level = select(home_level(own), 0u, is_listed);
    walk.around = select(list.level[walk.level].cells, vec3(1u), is_listed);
    walk.base = select(list.level[walk.level].base, list.cells, is_listed);
    let row = (own - walk.base) / walk.around.x;
    let x = own - walk.base - row * walk.around.x;
    let z = row / walk.around.y;
    let y = row - z * walk.around.y;
    // The half of the cells around that comes behind the own row in x, then in y, then in z.
    walk.first = vec3(previous(x, walk.around.x), previous(y, walk.around.y), z);
    walk.cells_per_row = min(walk.around.x, 3u);
    walk.rows_per_plane = min(walk.around.y, 3u);
    walk.row = walk.rows_per_plane / 2u;
    walk.end = walk.rows_per_plane * min(walk.around.z, 2u);
    walk.levels = select(list.level[walk.level].looked_at, 0u, is_listed);
    if (!is_listed && list.level[walk.level].meets_itself == 0u) {
        walk.cells_per_row = 0u;
        walk.row = 0u;
        walk.end = 0u;
    }
    return walk;
}

// The cell before this one, round the ring.
fn previous(cell: u32, around: u32) -> u32 {
    return select(cell, around, cell == 0u) - 1u;
}

fn next(cell: u32, around: u32) -> u32 {
    return select(cell + 1u, 0u, cell + 1u == around);
}

fn home_level(cell: u32) -> u32 {
    var level = 0u;
    for (var left = list.levels & ~1u; left != 0u; left &= left - 1u) {
        let other = firstTrailingBit(left);
        level = select(level, other, list.level[other].base <= cell);
    }
    return level;
}

fn next_row(walk: Walk) -> RowOfCells {
    let plane = walk.row / walk.rows_per_plane;
    let in_plane = walk.row - plane * walk.rows_per_plane;
    let y = walk.first.y + in_plane;
    let z = walk.first.z + plane;
    return RowOfCells(
        walk.row,
        y - select(0u, walk.around.y, y >= walk.around.y),
        z - select(0u, walk.around.z, z >= walk.around.z),
        in_plane,
    );
}

fn row_after(walk: Walk, row: RowOfCells) -> RowOfCells {
    let is_last = row.in_plane + 1u == walk.rows_per_plane;
    return RowOfCells(
        row.number + 1u,
        select(next(row.y, walk.around.y), walk.first.y, is_last),
        select(row.z, next(row.z, walk.around.z), is_last),
        select(row.in_plane + 1u, 0u, is_last),
    );
}

// The stretch of sorted spheres in a row of cells, for the sphere at `position` in the cell `own`.
fn stretch_of(walk: Walk, row: RowOfCells, position: u32, own: u32) -> vec2<u32> {
    let cell = walk.base + (row.z * walk.around.y + row.y) * walk.around.x;
    // In the sphere's own row half of the cells are behind it.
    let is_own = own - cell < walk.around.x;
    let seam = walk.around.x;
    let x = select(walk.first.x, own - cell, is_own);
    let end = x + select(walk.cells_per_row, min(seam, 2u), is_own);
    let first = starts[cell + select(x, 0u, walk.beyond)];
    let last = starts[cell + select(min(end, seam), max(end, seam) - seam, walk.beyond)];
    let begin = select(first, position + 1u, is_own && !walk.beyond);
    return select(vec2(0u), vec2(begin, last), row.number < walk.end);
}

// The candidates of the next rows of cells; behind the last of all rows the listed spheres.
fn next_rows(walk: Walk, position: u32, own: u32) -> Stretches {
    let row_a = next_row(walk);
    let row_b = row_after(walk, row_a);
    let row_c = row_after(walk, row_b);
    let row_d = row_after(walk, row_c);
    let row_e = row_after(walk, row_d);
    let a = stretch_of(walk, row_a, position, own);
    let b = stretch_of(walk, row_b, position, own);
    let c = stretch_of(walk, row_c, position, own);
    let d = stretch_of(walk, row_d, position, own);
    let e = stretch_of(walk, row_e, position, own);
    let wraps = !walk.beyond && walk.first.x + walk.cells_per_row > walk.around.x;
    let ends = own < list.cells && walk.row + ROWS_AT_ONCE >= walk.end && !wraps && walk.levels == 0u;
    let begin = max(starts[list.cells], position + 1u);
    let listed = select(0u, max(starts[list.cells + 1u], begin) - begin, ends);
    var until = vec4(a.y, b.y, c.y, d.y) - vec4(a.x, b.x, c.x, d.x);
    until.y += until.x;
    until.z += until.y;
    until.w += until.z;
    let shift = vec4(a.x, b.x - until.x, c.x - until.y, d.x - until.z);
    let last = until.w + e.y - e.x;
    return Stretches(until, shift, last, vec2(e.x - until.w, begin - last), last + listed, wraps);
}

// Goes on from some rows to those behind them, or to what they have beyond the seam.
fn walk_past(walk: ptr<function, Walk>, stretches: Stretches) {
    (*walk).passed += stretches.total;
    (*walk).taken = 0u;
    (*walk).beyond = stretches.wraps;
    (*walk).row = select(min((*walk).row + ROWS_AT_ONCE, (*walk).end), (*walk).row, stretches.wraps);
}

// Goes on from the end of a level to the next of those that are left.
fn walk_on(walk: ptr<function, Walk>, sphere: vec4<f32>, radius: f32) {
    let levels = (*walk).levels;
    (*walk).level = NOWHERE;
    if (levels != 0u) {
        let next = firstLeadingBit(levels);
        (*walk).levels = levels & ~(1u << next);
        enter_box(walk, next, sphere, radius);
    }
}

// Enters the box of a sphere, of no more than this effective radius, at a level whose edges are no shorter than those of its
// own.
fn enter_box(walk: ptr<function, Walk>, level: u32, sphere: vec4<f32>, radius: f32) {
    let around = list.level[level].cells;
    let reach = radius + list.level[level].reach;
    let half = vec3(reach * 0x1.00001p0) + abs(sphere.xyz) * 0x1p-22 + periods() * 0x1p-21;
    let low = cell_numbers(clamp(sphere.xyz - half, vec3(-FARTHEST), vec3(FARTHEST)), level);
    let high = cell_numbers(clamp(sphere.xyz + half, vec3(-FARTHEST), vec3(FARTHEST)), level);
    var first = in_ring(low, around);
    var span = min(high - low, around - vec3(1u)) + vec3(1u);
#ifdef PERIODIC
    // A box as wide as the period is all of it; its corners may be too far off to be counted.
    let whole = (periods() > vec3(0.0)) & (2.0 * half >= periods());
    first = select(first, vec3(0u), whole);
    span = select(span, around, whole);
#endif
    (*walk).level = level;
    (*walk).around = around;
    (*walk).base = list.level[level].base;
    (*walk).first = first;
    (*walk).cells_per_row = span.x;
    (*walk).rows_per_plane = span.y;
    (*walk).row = 0u;
    (*walk).end = span.y * span.z;
}
