// Where a sphere is at home: in level 0 where its cell there has few spheres, else at the level of its class.
struct Home {
    // In the table.
    cell: u32,
    // How many spheres there are in the cell of level 0 that it leaves; 0 where it does not.
    crowd: u32,
    // Whether it is in a cell of level 0 that it could leave.
    could_leave: bool,
}

#include density_slot

fn home_of(index: u32, sphere: vec4<f32>) -> Home {
    if (!may_pair(index, sphere)) {
        return Home(list.cells + 1u, 0u, false);
    }
    let own = level_of(class_of(effective_radius(index, sphere)));
    if (own == LISTED) {
        return Home(list.cells, 0u, false);
    }
    let position = image_of(sphere).xyz;
    let first = side_of(index) * LEVELS;
    // If there is no table all leave. Its own cell is a part of that of level 0, and tells how crowded this is at
    // least.
    var level = first + select(0u, own, list.is_dense != 0u && call.density_slots == 0u);
    var home = Home(0u, 0u, own != 0u);
    for (var turn = 0u; turn < 2u; turn++) {
        home.cell = cell_of(position, level);
        if (level == first + own || list.is_dense == 0u) {
            break;
        }
        let crowd = atomicLoad(&density[density_slot(home.cell)]);
        if (crowd <= call.tau) {
            break;
        }
        home = Home(0u, crowd, false);
        level = first + own;
    }
    return home;
}

var<workgroup> group_crowd: atomic<u32>;

// Keeps for the next call that cells of level 0 were crowded. Called by all threads of a workgroup.
fn keep_crowd(crowd: u32, lane: u32) {
    if (lane == 0u) {
        atomicStore(&group_crowd, 0u);
    }
    workgroupBarrier();
    if (crowd != 0u) {
        atomicMax(&group_crowd, crowd);
    }
    workgroupBarrier();
    if (lane == 0u) {
        let largest = atomicLoad(&group_crowd);
        if (largest > atomicLoad(&outcome.densest)) {
            atomicMax(&outcome.densest, largest);
        }
    }
}
