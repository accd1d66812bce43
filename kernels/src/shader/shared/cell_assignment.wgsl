// A sphere's cell: at level 0 if few spheres are in it, else at the level of the size class.
struct CellAssignment {
    cell: u32,
    // Nonzero if the sphere leaves level 0.
    occupancy: u32,
    can_descend: bool,
}

#include occupancy_slot

fn assign_cell(index: u32, sphere: vec4<f32>) -> CellAssignment {
    if (!may_pair(index, sphere)) {
        return CellAssignment(cell_list.cells + 1u, 0u, false);
    }
    let own = level_of(class_of(effective_radius(index, sphere)));
    if (own == LISTED) {
        return CellAssignment(cell_list.cells, 0u, false);
    }
    let position = wrapped_sphere(sphere).xyz;
    let first = side_of(index) * params.levels_per_side;
    // Without an occupancy table, every sphere uses its own level, whose occupancy is a lower bound for level 0.
    var level = first + select(0u, own, cell_list.has_overfull_cells != 0u && params.occupancy_slots == 0u);
    var assigned = CellAssignment(0u, 0u, own != 0u);
    for (var iteration = 0u; iteration < 2u; iteration++) {
        assigned.cell = cell_of(position, level);
        if (level == first + own || cell_list.has_overfull_cells == 0u) {
            break;
        }
        let count = atomicLoad(&occupancy[occupancy_slot(assigned.cell)]);
        if (count <= params.tau) {
            break;
        }
        assigned = CellAssignment(0u, count, false);
        level = first + own;
    }
    return assigned;
}

var<workgroup> group_occupancy: atomic<u32>;

// Records the largest occupancy for the next call. Whole workgroups must call it.
fn record_occupancy(occupancy: u32, local_index: u32) {
    if (local_index == 0u) {
        atomicStore(&group_occupancy, 0u);
    }
    workgroupBarrier();
    if (occupancy != 0u) {
        atomicMax(&group_occupancy, occupancy);
    }
    workgroupBarrier();
    if (local_index == 0u) {
        let largest = atomicLoad(&group_occupancy);
        if (largest > atomicLoad(&outcome.max_occupancy)) {
            atomicMax(&outcome.max_occupancy, largest);
        }
    }
}
