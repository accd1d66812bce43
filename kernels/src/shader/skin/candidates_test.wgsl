#include layout
#include thread
#include skin

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read> candidates: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> state: SkinState;
@group(0) @binding(3) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> outcome: Outcome;
@group(0) @binding(5) var<storage, read_write> pairs: array<vec2<u32>>;
#ifdef SPECIES
@group(0) @binding(6) var<storage, read> species: array<u32>;
@group(0) @binding(7) var<storage, read> table: array<f32>;
#endif
#include overlap
#include wrapped_sphere
#include pairs

var<workgroup> group_hits: atomic<u32>;
var<workgroup> first_position: u32;

fn is_hit(candidate: vec2<u32>) -> bool {
    let a = wrapped_sphere(spheres[candidate.x]);
    let b = wrapped_sphere(spheres[candidate.y]);
#ifdef SPECIES
    return is_pair(a, b, species[candidate.x], species[candidate.y]);
#else
    return is_pair(a, b);
#endif
}

@compute @workgroup_size(256)
fn candidates_test(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let number = (params.first_workgroup + workgroup_index(id, groups)) * 256u + thread.local_index;
    if (thread.local_index == 0u) {
        atomicStore(&group_hits, 0u);
    }
    workgroupBarrier();
    var candidate = vec2(0u);
    var hit = false;
    var before = 0u;
    if (number < state.candidates) {
        candidate = candidates[number];
        hit = is_asked_for(candidate.x, candidate.y) && is_hit(candidate);
    }
    if (hit) {
        before = atomicAdd(&group_hits, 1u);
    }
    workgroupBarrier();
    if (thread.local_index == 0u) {
        let total = atomicLoad(&group_hits);
        var first = 0u;
        if (total != 0u) {
            first = found_reserve(total);
        }
        first_position = first;
    }
    let first = workgroupUniformLoad(&first_position);
    if (hit && first < params.pair_capacity) {
        pair_write(first + before, candidate.x, candidate.y);
    }
}
