#include layout
#include cell_list
#include thread

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> cell_list: CellListLayout;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> cells: array<u32>;
@group(0) @binding(4) var<storage, read> order: array<u32>;
@group(0) @binding(5) var<storage, read_write> sorted: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> outcome: Outcome;
#ifdef SPECIES
@group(0) @binding(7) var<storage, read> species: array<u32>;
@group(0) @binding(8) var<storage, read_write> sorted_species: array<u32>;
#endif
#include store_sorted
#ifdef REUSE
#include cell_list_reuse

fn is_overfull(position: u32) -> bool {
    let cell = cells[position];
    let limit = max_occupancy_of(cell);
    return limit < cell_list.spheres - position && cells[position + limit] == cell;
}
#endif

@compute @workgroup_size(256)
fn spheres_gather(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let position = workgroup_index(id, groups) * 256u + thread.local_index;
#ifdef REUSE
    if (position == 0u) {
        reuse_outcome();
    }
#endif
    if (position >= cell_list.spheres) {
        return;
    }
#ifdef REUSE
    if (is_overfull(position)) {
        refuse_layout();
    }
#endif
    store_sorted(position, order[position]);
}
