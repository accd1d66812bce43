// A sphere's way through its candidates: stretches of the sorted spheres, one after another, so that every pair is met
// from one of its two spheres and only once.
//
// A sphere in a cell looks, at its own level, at the spheres that come later in its cell and at those of one half of the
// cells around, row by row; then, at each coarser level that has spheres, at all cells that its box touches when widened
// by that level's reach; at last at the listed spheres. A listed one looks at the listed ones behind it.

struct Walk {
    // Level whose cells come next; LISTED for the listed spheres, above it at the end.
    level: u32,
    // Row of cells that comes next at that level, out of so many.
    row: u32,
    rows: u32,
    // Cells of the box at that level: the first on each axis, and how many there are.
    first: vec3<u32>,
    span: vec3<u32>,
    // Cells of the row beyond the seam, yet to come.
    rest: vec2<u32>,
    // The stretch that is walked now.
    at: u32,
    end: u32,
    // Candidates that belong to earlier shares, and those that still belong to this one.
    skip: u32,
    left: u32,
    // Whether there are no more at all.
    done: bool,
}

fn walk_begin(cell: u32) -> Walk {
    var walk: Walk;
    walk.level = LISTED;
    if (cell < list.cells) {
        walk.level = home_level(cell);
        let cells = list.level[walk.level].cells;
        let local = cell - list.level[walk.level].base;
        let own = vec3(local % cells.x, (local / cells.x) % cells.y, local / (cells.x * cells.y));
        walk.first = vec3(previous(own.x, cells.x), previous(own.y, cells.y), own.z);
        walk.span = min(cells, vec3(3u, 3u, 2u));
        walk.rows = walk.span.y * walk.span.z;
        // The rows before are those of the other half.
        walk.row = select(0u, 1u, cells.y > 1u);
    }
    return walk;
}

// The cell before this one, round the ring.
fn previous(cell: u32, cells: u32) -> u32 {
    return select(cell, cells, cell == 0u) - 1u;
}

fn home_level(cell: u32) -> u32 {
    var level = 0u;
    for (var other = 1u; other < LEVELS; other++) {
        if (list.level[other].cells.x != 0u && list.level[other].base <= cell) {
            level = other;
        }
    }
    return level;
}

// The next coarser level that has spheres.
fn coarser(level: u32) -> u32 {
    let left = list.levels & ((1u << level) - 1u);
    return select(firstLeadingBit(left), LISTED, left == 0u);
}

// Goes on with the box of a sphere at a coarser level than its own.
fn walk_box(walk: ptr<function, Walk>, sphere: vec4<f32>, radius: f32) {
    let level = (*walk).level;
    let cells = list.level[level].cells;
    let reach = radius + list.level[level].reach;
    let half = vec3(reach * 0x1.00001p0) + abs(sphere.xyz) * 0x1p-22 + periods() * 0x1p-21;
    let low = cell_numbers(clamp(sphere.xyz - half, vec3(-FARTHEST), vec3(FARTHEST)), level);
    let high = cell_numbers(clamp(sphere.xyz + half, vec3(-FARTHEST), vec3(FARTHEST)), level);
    (*walk).first = low % cells;
    (*walk).span = min(high - low, cells - vec3(1u)) + vec3(1u);
#ifdef PERIODIC
    // A box as wide as the period is all of it; its corners may be too far off to be counted.
    let whole = (periods() > vec3(0.0)) & (2.0 * half >= periods());
    (*walk).first = select((*walk).first, vec3(0u), whole);
    (*walk).span = select((*walk).span, cells, whole);
#endif
    (*walk).row = 0u;
    (*walk).rows = (*walk).span.y * (*walk).span.z;
}

// Sets out on the next stretch, which may be empty. `position` is the sphere's own place, in the cell `cell`.
// False when all is done.
fn walk_on(walk: ptr<function, Walk>, position: u32, cell: u32, sphere: vec4<f32>, radius: f32) -> bool {
    if ((*walk).rest.y != 0u) {
        (*walk).at = starts[(*walk).rest.x];
        (*walk).end = starts[(*walk).rest.x + (*walk).rest.y];
        (*walk).rest.y = 0u;
        return true;
    }
    if ((*walk).level < LISTED && (*walk).row == (*walk).rows) {
        (*walk).level = coarser((*walk).level);
        if ((*walk).level != LISTED) {
            walk_box(walk, sphere, radius);
        }
    }
    if ((*walk).level == LISTED) {
        (*walk).level = LISTED + 1u;
        (*walk).at = max(starts[list.cells], position + 1u);
        (*walk).end = starts[list.cells + 1u];
        return true;
    }
    if ((*walk).level > LISTED) {
        return false;
    }
    let level = (*walk).level;
    let cells = list.level[level].cells;
    var y = (*walk).first.y + (*walk).row % (*walk).span.y;
    var z = (*walk).first.z + (*walk).row / (*walk).span.y;
    y -= select(0u, cells.y, y >= cells.y);
    z -= select(0u, cells.z, z >= cells.z);
    let row = list.level[level].base + (z * cells.y + y) * cells.x;
    // The sphere's own row, where half of the cells are behind it.
    let is_own = cell >= row && cell - row < cells.x;
    var x = (*walk).first.x;
    var span = (*walk).span.x;
    if (is_own) {
        x = cell - row;
        span = min(cells.x, 2u);
    }
    let end = min(x + span, cells.x);
    (*walk).at = select(starts[row + x], position + 1u, is_own);
    (*walk).end = starts[row + end];
    (*walk).rest = vec2(row, x + span - end);
    (*walk).row += 1u;
    return true;
}
