// Workgroups stride over the spheres, so that few contend for the counters in memory.
#include layout
#include cell_list
#include thread
#include sphere

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> count_source: array<u32>;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> stats: InputStats;
@group(0) @binding(4) var<storage, read_write> starts: array<u32>;
@group(0) @binding(5) var<storage, read_write> occupancy: array<u32>;
#ifdef SPECIES
@group(0) @binding(6) var<storage, read> species: array<u32>;
@group(0) @binding(7) var<storage, read> species_params: array<vec2<u32>>;
#endif
#include effective_radius
#include side
#include float_order
#include subgroup_max
#include stats

@compute @workgroup_size(256)
fn stats_reduce(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    reduce_stats(workgroup_index(id, groups) * 256u + thread.local_index, groups.x * groups.y * 256u, thread);
}
