// Clears the density table.
#include layout
#include place

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read> grid: Grid;
@group(0) @binding(2) var<storage, read_write> density: array<atomic<u32>>;

const ITEMS: u32 = #{SPHERES_PER_THREAD}u;

@compute @workgroup_size(256)
fn density_clear(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    let group = number_of_group(id, groups);
    if (grid.refinement != 2u) {
        return;
    }
    for (var item = 0u; item < ITEMS; item++) {
        let slot = (group * ITEMS + item) * 256u + place.lane;
        if (slot < 2u * call.density_slots) {
            atomicStore(&density[slot], 0u);
        }
    }
}
