// On unbounded axes, coordinates times a power of two are rounded down to fixed-point units, which are divided as
// integers. So all kernels compute the same cell, and touching spheres lie in neighboring cells.

// The cell of coordinate 0, before `low` is subtracted.
const MIDDLE: u32 = 0x40000000u;
const MAX_FAR_CELLS: u32 = 0x1fffffffu;

// Counts cells modulo 2^32, for at most 2^30 units. A float estimate, corrected by integers, is faster than a division.
fn quotient(units: f32) -> u32 {
    let inverse = 1.0 / f32(cell_list.units_per_cell);
    let near = floor(units * inverse);
    let rest = i32(units) - i32(near) * i32(cell_list.units_per_cell);
    let nearer = floor(f32(rest) * inverse);
    let last = rest - i32(nearer) * i32(cell_list.units_per_cell);
    let step = select(select(0, 1, last >= i32(cell_list.units_per_cell)), -1, last < 0);
    return bitcast<u32>(i32(near) + i32(nearer) + step);
}

// At or above `far`, each float has its own cell.
fn open_number(x: f32, level: u32) -> u32 {
    let far = cell_list.level[level].far;
    let size = bitcast<u32>(abs(x));
    let is_far = size >= far;
    let far_cells = select(0u, min(size - far, MAX_FAR_CELLS), is_far);
    let farthest = select(0x1p30, -0x1p30, x < 0.0);
    let near = MIDDLE + quotient(select(floor(x * cell_list.level[level].units_per_length), farthest, is_far));
    return select(near + far_cells, near - far_cells, x < 0.0);
}

#ifdef PERIODIC
// Adds `around`, for coordinates up to half a period past the boundary.
fn ring_number(x: f32, around: u32, per_length: f32) -> u32 {
    return u32(i32(floor(x * per_length + 0.5 * f32(around))) + i32(around));
}
#endif

fn cell_numbers(position: vec3<f32>, level: u32) -> vec3<u32> {
    var numbers = vec3(open_number(position.x, level), open_number(position.y, level), open_number(position.z, level))
        - cell_list.level[level].low;
#ifdef PERIODIC
    let around = cell_list.level[level].around;
    let per_length = cell_list.level[level].cells_per_length;
    let ring = vec3(
        ring_number(position.x, around.x, per_length.x),
        ring_number(position.y, around.y, per_length.y),
        ring_number(position.z, around.z, per_length.z),
    );
    numbers = select(numbers, ring, periods() > vec3(0.0));
#endif
    return numbers;
}

fn in_ring(numbers: vec3<u32>, around: vec3<u32>) -> vec3<u32> {
    var cells = numbers;
    if (any(numbers >= around)) {
        cells = numbers % around;
    }
    return cells;
}

fn cell_index(cell: vec3<u32>, level: u32) -> u32 {
    let cells = cell_list.level[level].cells;
    return cell_list.level[level].base + (cell.z * cells.y + cell.y) * cells.x + cell.x;
}

fn cell_of(position: vec3<f32>, level: u32) -> u32 {
    return cell_index(in_ring(cell_numbers(position, level), cell_list.level[level].cells), level);
}

fn class_of(radius: f32) -> u32 {
    return (bitcast<u32>(radius) >> 23u) & 255u;
}

fn level_of(size_class: u32) -> u32 {
    return (cell_list.class_levels[size_class / 4u] >> ((size_class % 4u) * 8u)) & 255u;
}
