// Counts the spheres per cell of level 0. Few workgroups stride over the spheres, because most calls need no counts.
#include layout
#include cell_list
#include thread
#include sphere

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> cell_list: CellListLayout;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> occupancy: array<atomic<u32>>;
#ifdef SPECIES
@group(0) @binding(4) var<storage, read> species: array<u32>;
@group(0) @binding(5) var<storage, read> species_params: array<vec2<u32>>;
#endif
#include effective_radius
#include side
#include periods
#include wrapped_sphere
#include cell_numbers
#include occupancy_slot

@compute @workgroup_size(256)
fn occupancy_count(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    if (cell_list.has_overfull_cells == 0u) {
        return;
    }
    let first = workgroup_index(id, groups) * 256u + thread.local_index;
    let stride = groups.x * groups.y * 256u;
    let rounds = (cell_list.spheres + stride - 1u) / stride;
    for (var round = 0u; round < rounds; round++) {
        let index = first + round * stride;
        if (index < cell_list.spheres) {
            let sphere = spheres[index];
            if (may_pair(index, sphere) && level_of(class_of(effective_radius(index, sphere))) != LISTED) {
                let cell = cell_of(wrapped_sphere(sphere).xyz, side_of(index) * params.levels_per_side);
                atomicAdd(&occupancy[occupancy_slot(cell)], 1u);
            }
        }
    }
}
