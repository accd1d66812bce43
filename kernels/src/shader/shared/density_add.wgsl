#include density

// A sphere of the cell's own depth, or a smaller one, overlaps the cell.
fn density_add(depth: u32, cell: vec3<i32>, is_own: bool) {
    let slot = density_slot(depth, cell);
    if (!is_own) {
        atomicAdd(&density[slot], 1u);
    } else if ((atomicLoad(&density[slot]) & HAS_OWN) == 0u) {
        atomicOr(&density[slot], HAS_OWN);
    }
}
