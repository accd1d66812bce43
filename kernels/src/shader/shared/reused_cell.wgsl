struct ReusedCell {
    cell: u32,
    // If false, the session repeats the call with other cells.
    suits: bool,
}

// A box begins fewer than this many cells below its center.
const MIN_NUMBER: u32 = 8u;

// Returns `true` if the sphere needs no guards.
fn is_ordinary_sphere(sphere: vec4<f32>, radius: f32) -> bool {
    let farthest = max(max(abs(sphere.x), abs(sphere.y)), abs(sphere.z));
    return radius > 0x1p-40 && radius < 0x1p58 && farthest < 0x1p58;
}

// Cells that depend on occupancies suit no sphere.
fn level_suits(level: u32, radius: f32) -> bool {
    let has_table = cell_list.has_overfull_cells != 0u && params.occupancy_slots != 0u;
    let has_cells = level < LEVELS && ((cell_list.levels >> (level % LEVELS)) & 1u) != 0u;
    return has_cells && !has_table && radius <= cell_list.level[level % LEVELS].max_radius;
}

fn reused_cell(index: u32, sphere: vec4<f32>) -> ReusedCell {
    if (!may_pair(index, sphere)) {
        // Only a call with new cells counts invalid spheres.
        return ReusedCell(cell_list.cells + 1u, is_accepted(index, sphere));
    }
    let radius = effective_radius(index, sphere);
    let own = level_of(class_of(radius));
    let is_tested = cell_list.ordinary == 0u || is_ordinary_sphere(sphere, radius);
    if (own == LISTED) {
        return ReusedCell(cell_list.cells, is_tested);
    }
    let level = side_of(index) * params.levels_per_side + select(0u, own, cell_list.has_overfull_cells != 0u);
    if (!is_tested || !level_suits(level, radius)) {
        return ReusedCell(cell_list.cells + 1u, false);
    }
    let numbers = cell_numbers(wrapped_sphere(sphere).xyz, level);
    // Above the bounds, cells form rings. Numbers below the first cell have wrapped past 0.
    let is_after_first = (numbers >= vec3(MIN_NUMBER)) & (numbers < vec3(0x80000000u));
    let suits = all(is_after_first | (periods() > vec3(0.0)));
    return ReusedCell(cell_index(in_ring(numbers, cell_list.level[level].cells), level), suits);
}
