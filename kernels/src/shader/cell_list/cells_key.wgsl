// Writes cells as sort keys, and counts the digits of the first radix pass.
#include layout
#include cell_list
#include thread
#include sphere

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<uniform> digit_pass: RadixPass;
@group(0) @binding(2) var<storage, read> cell_list: CellListLayout;
@group(0) @binding(3) var<storage, read> sort_counts: SortCounts;
@group(0) @binding(4) var<storage, read> count_source: array<u32>;
@group(0) @binding(5) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> occupancy: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> outcome: Outcome;
@group(0) @binding(8) var<storage, read_write> keys: array<u32>;
@group(0) @binding(9) var<storage, read_write> counts: array<u32>;
#ifdef SPECIES
@group(0) @binding(10) var<storage, read> species: array<u32>;
@group(0) @binding(11) var<storage, read> species_params: array<vec2<u32>>;
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
#include digit_pass

const WORKGROUP_SIZE: u32 = 256u;
const ITEMS: u32 = #{RADIX_ITEMS}u;

var<workgroup> histogram: array<atomic<u32>, 256>;

@compute @workgroup_size(256)
fn cells_key(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let group = workgroup_index(id, groups);
    let start = group * WORKGROUP_SIZE * ITEMS;
#ifdef REUSE
    var suits = group + thread.local_index != 0u || count_source[0] == cell_list.spheres;
    if (!suits) {
        refuse_layout();
    }
#endif
    if (start >= cell_list.spheres) {
        return;
    }
    atomicStore(&histogram[thread.local_index], 0u);
    workgroupBarrier();
    var occupancy = 0u;
    for (var item = 0u; item < ITEMS; item++) {
        let index = start + item * WORKGROUP_SIZE + thread.local_index;
        if (index < cell_list.spheres) {
#ifdef REUSE
            let assigned = reused_cell(index, spheres[index]);
            suits = suits && assigned.suits;
#else
            let assigned = assign_cell(index, spheres[index]);
            occupancy = max(occupancy, assigned.occupancy);
#endif
            keys[index] = assigned.cell;
            atomicAdd(&histogram[digit_of(assigned.cell)], 1u);
        }
    }
#ifdef REUSE
    if (!suits) {
        refuse_layout();
    }
#endif
    if (cell_list.has_overfull_cells != 0u) {
        record_occupancy(occupancy, thread.local_index);
    }
    workgroupBarrier();
    counts[thread.local_index * (sort_counts.counters / 256u) + group] = atomicLoad(&histogram[thread.local_index]);
}
