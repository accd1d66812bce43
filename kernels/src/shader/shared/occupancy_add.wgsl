#include occupancy

fn occupancy_add(depth: u32, cell: vec3<i32>, is_own: bool) {
    let slot = occupancy_slot(depth, cell);
    if (!is_own) {
        atomicAdd(&occupancy[slot], 1u);
    } else if ((atomicLoad(&occupancy[slot]) & HAS_OWN) == 0u) {
        atomicOr(&occupancy[slot], HAS_OWN);
    }
}
