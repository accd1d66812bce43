// Where a sphere is at home: in level 0 where its cell there has few spheres, else at the level of its class.
struct CellAssignment {
    // In the table.
    cell: u32,
    // How many spheres there are in the cell of level 0 that it leaves; 0 where it does not.
    occupancy: u32,
    // Whether it is in a cell of level 0 that it could leave.
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
    let first = side_of(index) * LEVELS;
    // If there is no table all leave. Its own cell is a part of that of level 0, and tells how crowded this is at
    // least.
    var level = first + select(0u, own, cell_list.has_overfull_cells != 0u && params.occupancy_slots == 0u);
    var assigned = CellAssignment(0u, 0u, own != 0u);
    for (var turn = 0u; turn < 2u; turn++) {
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

// Keeps for the next call that cells of level 0 were crowded. Called by all threads of a workgroup.
fn record_occupancy(occupancy: u32, lane: u32) {
    if (lane == 0u) {
        atomicStore(&group_occupancy, 0u);
    }
    workgroupBarrier();
    if (occupancy != 0u) {
        atomicMax(&group_occupancy, occupancy);
    }
    workgroupBarrier();
    if (lane == 0u) {
        let largest = atomicLoad(&group_occupancy);
        if (largest > atomicLoad(&outcome.max_occupancy)) {
            atomicMax(&outcome.max_occupancy, largest);
        }
    }
}
