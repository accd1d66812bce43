#include layout
#include cell_list
#include thread
#include sphere

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> cell_list: CellListLayout;
@group(0) @binding(2) var<storage, read> count_source: array<u32>;
@group(0) @binding(3) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> occupancy: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> outcome: Outcome;
@group(0) @binding(6) var<storage, read_write> starts: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> cell_ranks: array<vec2<u32>>;
#ifdef SPECIES
@group(0) @binding(8) var<storage, read> species: array<u32>;
@group(0) @binding(9) var<storage, read> species_params: array<vec2<u32>>;
#endif
#include effective_radius
#include side
#include periods
#include wrapped_sphere
#include cell_numbers
#include cell_assignment
#ifdef REUSE
#include cell_list_reuse
#include reused_cell
#endif

@compute @workgroup_size(256)
fn cells_count(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let index = workgroup_index(id, groups) * 256u + thread.local_index;
#ifdef REUSE
    var suits = index != 0u || count_source[0] == cell_list.spheres;
    if (index < cell_list.spheres) {
        let reused = reused_cell(index, spheres[index]);
        let before = atomicAdd(&starts[reused.cell], 1u);
        cell_ranks[index] = vec2(reused.cell, before);
        suits = suits && reused.suits && before < max_occupancy_of(reused.cell);
    }
    if (!suits) {
        refuse_layout();
    }
#else
    var occupancy = 0u;
    if (index < cell_list.spheres) {
        let assigned = assign_cell(index, spheres[index]);
        let before = atomicAdd(&starts[assigned.cell], 1u);
        cell_ranks[index] = vec2(assigned.cell, before);
        occupancy = assigned.occupancy;
        if (assigned.can_descend && before >= max(params.tau, atomicLoad(&outcome.max_occupancy))) {
            atomicMax(&outcome.max_occupancy, before + 1u);
        }
    }
    if (cell_list.has_overfull_cells != 0u) {
        record_occupancy(occupancy, thread.local_index);
    }
#endif
}
