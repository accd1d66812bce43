// The candidates of a sphere: rows of cells, each one or two ranges of sorted spheres. Every pair is found from exactly
// one sphere, which is compared with
// - the later spheres of its own cell, and of half of the adjacent cells, if its level searches itself;
// - at each searched level, all cells that its box overlaps when widened by that level's radius;
// - the listed spheres, which have one cell without adjacent cells.

const NO_LEVEL: u32 = 256u;

struct NeighborCells {
    level: u32,
    around: vec3<u32>,
    base: u32,
    // The first cell of the current box.
    first: vec3<u32>,
    cells_per_row: u32,
    rows_per_plane: u32,
    row: u32,
    end: u32,
    past_boundary: bool,
    levels: u32,
    // Tested candidates of the current rows, and candidates of earlier rows.
    tested: u32,
    skipped: u32,
}

const ROWS_PER_STEP: u32 = 5u;

struct CellRow {
    number: u32,
    y: u32,
    z: u32,
    in_plane: u32,
}

// Up to five rows, and after the last row the listed spheres. A range's candidates have consecutive numbers below
// `until`; a number plus `shift` is a position in cell order.
struct CandidateRanges {
    until: vec4<u32>,
    shift: vec4<u32>,
    last_until: u32,
    last_shifts: vec2<u32>,
    total: u32,
    wraps: bool,
}

fn candidate_at(ranges: CandidateRanges, number: u32) -> u32 {
    var shift = select(ranges.shift.x, ranges.shift.y, number >= ranges.until.x);
    shift = select(shift, ranges.shift.z, number >= ranges.until.y);
    shift = select(shift, ranges.shift.w, number >= ranges.until.z);
    shift = select(shift, ranges.last_shifts.x, number >= ranges.until.w);
    return number + select(shift, ranges.last_shifts.y, number >= ranges.last_until);
}

fn neighbor_cells_of(own: u32) -> NeighborCells {
    let is_listed = own >= cell_list.cells;
    var neighbors: NeighborCells;
    neighbors.level = select(level_of_cell(own), 0u, is_listed);
    neighbors.around = select(cell_list.level[neighbors.level].cells, vec3(1u), is_listed);
    neighbors.base = select(cell_list.level[neighbors.level].base, cell_list.cells, is_listed);
    let row = (own - neighbors.base) / neighbors.around.x;
    let x = own - neighbors.base - row * neighbors.around.x;
    let z = row / neighbors.around.y;
    let y = row - z * neighbors.around.y;
    // The adjacent cells that follow the own row in x, then in y, then in z.
    neighbors.first = vec3(previous(x, neighbors.around.x), previous(y, neighbors.around.y), z);
    neighbors.cells_per_row = min(neighbors.around.x, 3u);
    neighbors.rows_per_plane = min(neighbors.around.y, 3u);
    neighbors.row = neighbors.rows_per_plane / 2u;
    neighbors.end = neighbors.rows_per_plane * min(neighbors.around.z, 2u);
    neighbors.levels = select(cell_list.level[neighbors.level].searched_levels, 0u, is_listed);
    if (!is_listed && cell_list.level[neighbors.level].searches_itself == 0u) {
        neighbors.cells_per_row = 0u;
        neighbors.row = 0u;
        neighbors.end = 0u;
    }
    return neighbors;
}

fn previous(cell: u32, around: u32) -> u32 {
    return select(cell, around, cell == 0u) - 1u;
}

fn next(cell: u32, around: u32) -> u32 {
    return select(cell + 1u, 0u, cell + 1u == around);
}

fn level_of_cell(cell: u32) -> u32 {
    var level = 0u;
    for (var left = cell_list.levels & ~1u; left != 0u; left &= left - 1u) {
        let other = firstTrailingBit(left);
        level = select(level, other, cell_list.level[other].base <= cell);
    }
    return level;
}

fn next_row(neighbors: NeighborCells) -> CellRow {
    let plane = neighbors.row / neighbors.rows_per_plane;
    let in_plane = neighbors.row - plane * neighbors.rows_per_plane;
    let y = neighbors.first.y + in_plane;
    let z = neighbors.first.z + plane;
    return CellRow(
        neighbors.row,
        y - select(0u, neighbors.around.y, y >= neighbors.around.y),
        z - select(0u, neighbors.around.z, z >= neighbors.around.z),
        in_plane,
    );
}

fn row_after(neighbors: NeighborCells, row: CellRow) -> CellRow {
    let is_last = row.in_plane + 1u == neighbors.rows_per_plane;
    return CellRow(
        row.number + 1u,
        select(next(row.y, neighbors.around.y), neighbors.first.y, is_last),
        select(row.z, next(row.z, neighbors.around.z), is_last),
        select(row.in_plane + 1u, 0u, is_last),
    );
}

fn range_of(neighbors: NeighborCells, row: CellRow, position: u32, own: u32) -> vec2<u32> {
    let cell = neighbors.base + (row.z * neighbors.around.y + row.y) * neighbors.around.x;
    // In the sphere's own row, earlier cells are skipped.
    let is_own = own - cell < neighbors.around.x;
    let ring = neighbors.around.x;
    let x = select(neighbors.first.x, own - cell, is_own);
    let end = x + select(neighbors.cells_per_row, min(ring, 2u), is_own);
    let first = starts[cell + select(x, 0u, neighbors.past_boundary)];
    let last = starts[cell + select(min(end, ring), max(end, ring) - ring, neighbors.past_boundary)];
    let begin = select(first, position + 1u, is_own && !neighbors.past_boundary);
    return select(vec2(0u), vec2(begin, last), row.number < neighbors.end);
}

fn next_ranges(neighbors: NeighborCells, position: u32, own: u32) -> CandidateRanges {
    let row_a = next_row(neighbors);
    let row_b = row_after(neighbors, row_a);
    let row_c = row_after(neighbors, row_b);
    let row_d = row_after(neighbors, row_c);
    let row_e = row_after(neighbors, row_d);
    let a = range_of(neighbors, row_a, position, own);
    let b = range_of(neighbors, row_b, position, own);
    let c = range_of(neighbors, row_c, position, own);
    let d = range_of(neighbors, row_d, position, own);
    let e = range_of(neighbors, row_e, position, own);
    let wraps = !neighbors.past_boundary && neighbors.first.x + neighbors.cells_per_row > neighbors.around.x;
    let ends = own < cell_list.cells && neighbors.row + ROWS_PER_STEP >= neighbors.end && !wraps && neighbors.levels == 0u;
    let begin = max(starts[cell_list.cells], position + 1u);
    let listed = select(0u, max(starts[cell_list.cells + 1u], begin) - begin, ends);
    var until = vec4(a.y, b.y, c.y, d.y) - vec4(a.x, b.x, c.x, d.x);
    until.y += until.x;
    until.z += until.y;
    until.w += until.z;
    let shift = vec4(a.x, b.x - until.x, c.x - until.y, d.x - until.z);
    let last = until.w + e.y - e.x;
    return CandidateRanges(until, shift, last, vec2(e.x - until.w, begin - last), last + listed, wraps);
}

fn skip_rows(neighbors: ptr<function, NeighborCells>, ranges: CandidateRanges) {
    (*neighbors).skipped += ranges.total;
    (*neighbors).tested = 0u;
    (*neighbors).past_boundary = ranges.wraps;
    (*neighbors).row = select(min((*neighbors).row + ROWS_PER_STEP, (*neighbors).end), (*neighbors).row, ranges.wraps);
}

// Replaces an infinite sum by the largest float, whose cell may have spheres. Compilers may assume that floats are
// finite, so integers decide.
fn up_to_largest(position: vec3<f32>) -> vec3<f32> {
    let bits = bitcast<vec3<u32>>(position);
    return bitcast<vec3<f32>>(min(bits & vec3(0x7fffffffu), vec3(0x7f7fffffu)) | (bits & vec3(0x80000000u)));
}

// `cutoff` is at least the sphere's largest cutoff with the level.
fn enter_level(neighbors: ptr<function, NeighborCells>, level: u32, sphere: vec4<f32>, cutoff: f32) {
    let around = cell_list.level[level].cells;
    let half = vec3(cutoff * 0x1.00001p0) + abs(sphere.xyz) * 0x1p-22 + periods() * 0x1p-21;
    let low = cell_numbers(up_to_largest(sphere.xyz - half), level);
    let high = cell_numbers(up_to_largest(sphere.xyz + half), level);
    var first = in_ring(low, around);
    var span = min(high - low, around - vec3(1u)) + vec3(1u);
#ifdef PERIODIC
    // A box as wide as the period overlaps all cells; its corners may be too far for cell numbers.
    let whole = (periods() > vec3(0.0)) & (2.0 * half >= periods());
    first = select(first, vec3(0u), whole);
    span = select(span, around, whole);
#endif
    (*neighbors).level = level;
    (*neighbors).around = around;
    (*neighbors).base = cell_list.level[level].base;
    (*neighbors).first = first;
    (*neighbors).cells_per_row = span.x;
    (*neighbors).rows_per_plane = span.y;
    (*neighbors).row = 0u;
    (*neighbors).end = span.y * span.z;
}
