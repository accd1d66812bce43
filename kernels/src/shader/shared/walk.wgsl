// A sphere's way through its candidates: rows of cells, each a stretch or two of the sorted spheres, so that every pair
// is met from one of its two spheres and only once.
//
// A sphere in a cell looks, at its own level, at the spheres that come later in its cell and at those of one half of the
// cells around; then, at each coarser level that has spheres, at all cells that its box touches when widened by that
// level's reach; at last at the listed spheres. A listed one looks at the listed ones behind it.

// Beyond the levels and the listed spheres there is nothing.
const NOWHERE: u32 = 256u;

struct Walk {
    // The level it is at; LISTED for the listed spheres, NOWHERE at the end.
    level: u32,
    // Cells of that level around each axis, and its first cell.
    around: vec3<u32>,
    base: u32,
    // Rows of cells there that are to come, in all and in the present plane, and how many a plane has.
    rows: u32,
    rows_in_plane: u32,
    rows_per_plane: u32,
    // The first cell of the next row, the first row of a plane, and how many cells a row has.
    cell: vec3<u32>,
    first_row: u32,
    span: u32,
    // Cells of the last row beyond the seam that are to come, from the first of the row on.
    beyond: u32,
    row: u32,
    // The present stretch of candidates: its next and its end.
    at: u32,
    end: u32,
    // Candidates that belong to earlier shares, and those that still belong to this one.
    skip: u32,
    left: u32,
}

fn walk_begin(position: u32, own: u32) -> Walk {
    var walk: Walk;
    if (own >= list.cells) {
        walk.level = LISTED;
        walk.at = position + 1u;
        walk.end = starts[list.cells + 1u];
        return walk;
    }
    walk.level = home_level(own);
    walk.around = list.level[walk.level].cells;
    walk.base = list.level[walk.level].base;
    let row = (own - walk.base) / walk.around.x;
    let x = own - walk.base - row * walk.around.x;
    let z = row / walk.around.y;
    let y = row - z * walk.around.y;
    walk.cell = vec3(previous(x, walk.around.x), y, z);
    walk.span = min(walk.around.x, 3u);
    walk.first_row = previous(y, walk.around.y);
    walk.rows_per_plane = min(walk.around.y, 3u);
    walk.rows_in_plane = min(walk.around.y, 2u);
    walk.rows = walk.rows_in_plane + select(0u, walk.rows_per_plane, walk.around.z > 1u);
    // In its own row what comes later in its cell, and the next cell.
    next_row(&walk);
    let span = min(walk.around.x, 2u);
    let end = min(x + span, walk.around.x);
    walk.beyond = x + span - end;
    walk.at = position + 1u;
    walk.end = starts[walk.row + end];
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

// Turns to the next row of cells.
fn next_row(walk: ptr<function, Walk>) {
    (*walk).row = (*walk).base + ((*walk).cell.z * (*walk).around.y + (*walk).cell.y) * (*walk).around.x;
    (*walk).rows -= 1u;
    (*walk).rows_in_plane -= 1u;
    let is_last = (*walk).rows_in_plane == 0u;
    (*walk).rows_in_plane = select((*walk).rows_in_plane, (*walk).rows_per_plane, is_last);
    (*walk).cell.y = select(next((*walk).cell.y, (*walk).around.y), (*walk).first_row, is_last);
    (*walk).cell.z = select((*walk).cell.z, next((*walk).cell.z, (*walk).around.z), is_last);
}

// Sets out on the next stretch of the level: the rest of a row beyond the seam, or another row.
fn next_stretch(walk: ptr<function, Walk>) {
    var first = 0u;
    var last = (*walk).beyond;
    (*walk).beyond = 0u;
    if (last == 0u) {
        next_row(walk);
        first = (*walk).cell.x;
        last = min(first + (*walk).span, (*walk).around.x);
        (*walk).beyond = first + (*walk).span - last;
    }
    (*walk).at = starts[(*walk).row + first];
    (*walk).end = starts[(*walk).row + last];
}

// Goes on from the end of a level to the next coarser one that has spheres, then to the listed spheres.
fn walk_up(walk: ptr<function, Walk>, sphere: vec4<f32>, radius: f32) {
    if ((*walk).level >= LISTED) {
        (*walk).level = NOWHERE;
        return;
    }
    let left = list.levels & ((1u << (*walk).level) - 1u);
    if (left == 0u) {
        (*walk).at = starts[list.cells];
        (*walk).end = starts[list.cells + 1u];
        (*walk).level = select(LISTED, NOWHERE, (*walk).at == (*walk).end);
        return;
    }
    let level = firstLeadingBit(left);
    let around = list.level[level].cells;
    let reach = radius + list.level[level].reach;
    let half = vec3(reach * 0x1.00001p0) + abs(sphere.xyz) * 0x1p-22 + periods() * 0x1p-21;
    let low = cell_numbers(clamp(sphere.xyz - half, vec3(-FARTHEST), vec3(FARTHEST)), level);
    let high = cell_numbers(clamp(sphere.xyz + half, vec3(-FARTHEST), vec3(FARTHEST)), level);
    var first = low % around;
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
    (*walk).cell = first;
    (*walk).first_row = first.y;
    (*walk).span = span.x;
    (*walk).rows = span.y * span.z;
    (*walk).rows_in_plane = span.y;
    (*walk).rows_per_plane = span.y;
}
