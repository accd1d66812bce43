#include layout
#include cell_list
#include thread

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> cell_list: CellListLayout;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> starts: array<u32>;
@group(0) @binding(4) var<storage, read> cell_ranks: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> sorted: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> cells: array<u32>;
@group(0) @binding(7) var<storage, read_write> order: array<u32>;
@group(0) @binding(8) var<storage, read_write> outcome: Outcome;
#ifdef SPECIES
@group(0) @binding(9) var<storage, read> species: array<u32>;
@group(0) @binding(10) var<storage, read_write> sorted_species: array<u32>;
#endif
#include store_sorted
#ifdef REUSE
#include cell_list_reuse
#endif

@compute @workgroup_size(256)
fn spheres_scatter(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let index = workgroup_index(id, groups) * 256u + thread.local_index;
#ifdef REUSE
    if (index == 0u) {
        reuse_outcome();
    }
#endif
    if (index >= cell_list.spheres) {
        return;
    }
    let assigned = cell_ranks[index];
    let position = starts[assigned.x] + assigned.y;
    store_sorted(position, index);
    cells[position] = assigned.x;
    order[position] = index;
}
