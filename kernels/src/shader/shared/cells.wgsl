// A sphere's first cell, and on each axis 1 if it overlaps a second.
struct Cells {
    first: vec3<i32>,
    more: vec3<i32>,
    depth: u32,
}

const NO_CELLS: vec2<u32> = vec2(0xffffffffu);

fn cells_packed(cells: Cells) -> vec2<u32> {
    let first = vec3<u32>(cells.first) & vec3(0x3ffffu);
    let more = vec3<u32>(cells.more);
    return vec2(
        first.x | (first.y << 18u),
        (first.y >> 14u) | (first.z << 4u) | (more.x << 22u) | (more.y << 23u) | (more.z << 24u)
            | (cells.depth << 25u),
    );
}

fn cells_unpacked(words: vec2<u32>) -> Cells {
    let first = vec3(words.x, (words.x >> 18u) | (words.y << 14u), words.y >> 4u);
    let more = (vec3(words.y) >> vec3(22u, 23u, 24u)) & vec3(1u);
    return Cells(
        extractBits(vec3<i32>(first), 0u, 18u),
        vec3<i32>(more),
        extractBits(words.y, 25u, 5u),
    );
}

// Grids nest, so a sphere overlaps at most two cells per axis of coarser depths as well.
fn cells_at(cells: Cells, depth: u32) -> Cells {
    let shift = vec3(cells.depth - depth);
    let first = cells.first >> shift;
    return gathered(Cells(first, ((cells.first + cells.more) >> shift) - first, depth));
}

#ifdef PERIODIC
fn cells_around(depth: u32) -> vec3<i32> {
    return vec3<i32>(min(grid.ring_cells * bitcast<f32>((127u + depth) << 23u), vec3(0x1p30)));
}

// Rings of two or three cells count as one, because spheres would share cells in which neither begins.
fn one_cell(depth: u32) -> vec3<bool> {
    return (grid.ring_cells != vec3(0.0)) & (cells_around(depth) < vec3(4));
}

fn gathered(cells: Cells) -> Cells {
    let one = one_cell(cells.depth);
    return Cells(select(cells.first, vec3(0), one), select(cells.more, vec3(0), one), cells.depth);
}

// A sphere's cells are numbered consecutively, also across the boundary.
fn in_ring(cell: vec3<i32>, depth: u32) -> vec3<i32> {
    let around = cells_around(depth);
    return cell + select(vec3(0), around, cell < vec3(0)) - select(vec3(0), around, cell >= around);
}
#else
fn gathered(cells: Cells) -> Cells {
    return cells;
}

fn in_ring(cell: vec3<i32>, depth: u32) -> vec3<i32> {
    return cell;
}
#endif

// One bit per axis.
fn step_of(number: u32) -> vec3<i32> {
    return (vec3(i32(number)) >> vec3(0u, 1u, 2u)) & vec3(1);
}

fn number_of(step: vec3<i32>) -> u32 {
    return u32(step.x | (step.y << 1u) | (step.z << 2u));
}

fn has_cell(cells: Cells, step: vec3<i32>) -> bool {
    return all(step <= cells.more);
}

fn parent_of(cell: vec3<i32>, depth: u32, parents: Cells) -> u32 {
    return number_of(clamp((cell >> vec3(depth - parents.depth)) - parents.first, vec3(0), parents.more));
}

fn depths_to(depths: u32, depth: u32) -> u32 {
    return depths & (0xffffffffu >> (31u - depth));
}
