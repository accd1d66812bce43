#include layout
#include cell_list
#include thread
#include sphere

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> count_source: array<u32>;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> stats: InputStats;
@group(0) @binding(4) var<storage, read_write> cell_list: CellListLayout;
@group(0) @binding(5) var<storage, read_write> outcome: Outcome;
@group(0) @binding(6) var<storage, read_write> sort_counts: SortCounts;
@group(0) @binding(7) var<storage, read_write> starts: array<u32>;
@group(0) @binding(8) var<storage, read_write> occupancy: array<u32>;
#ifdef SPECIES
@group(0) @binding(9) var<storage, read> species: array<u32>;
@group(0) @binding(10) var<storage, read> species_params: array<vec2<u32>>;
#endif
#include effective_radius
#include side
#include float_order
#include subgroup_max
#include periods
#include wrapped_sphere
#include cell_numbers
#include stats
#include cell_list_setup

@compute @workgroup_size(256)
fn cell_list_setup_small(
#include thread_builtins
) {
#include thread_from_builtins
    reduce_stats(thread.local_index, 256u, thread);
    storageBarrier();
    workgroupBarrier();
    configure(thread.local_index);
}
