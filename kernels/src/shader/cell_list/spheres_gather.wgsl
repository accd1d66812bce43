#include layout
#include cell_list
#include thread

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> cell_list: CellListLayout;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> order: array<u32>;
@group(0) @binding(4) var<storage, read_write> sorted: array<vec4<f32>>;
#ifdef SPECIES
@group(0) @binding(5) var<storage, read> species: array<u32>;
@group(0) @binding(6) var<storage, read_write> sorted_species: array<u32>;
#endif
#include store_sorted

@compute @workgroup_size(256)
fn spheres_gather(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let position = workgroup_index(id, groups) * 256u + thread.local_index;
    if (position >= cell_list.spheres) {
        return;
    }
    store_sorted(position, order[position]);
}
