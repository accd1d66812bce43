#include layout
#include thread

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> grid: Grid;
@group(0) @binding(2) var<storage, read_write> occupancy: array<atomic<u32>>;

const ITEMS: u32 = #{SPHERES_PER_THREAD}u;

@compute @workgroup_size(256)
fn occupancy_clear(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let group = workgroup_index(id, groups);
    if (grid.split_policy != 2u) {
        return;
    }
    for (var item = 0u; item < ITEMS; item++) {
        let slot = (group * ITEMS + item) * 256u + thread.local_index;
        if (slot < 2u * params.occupancy_slots) {
            atomicStore(&occupancy[slot], 0u);
        }
    }
}
