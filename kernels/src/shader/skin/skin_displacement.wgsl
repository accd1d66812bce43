// Finds the largest displacement since the list was built, and changes of spheres. Spheres that never pair may move and
// grow.
#include layout
#include thread
#include sphere
#include skin

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<uniform> skin: SkinParams;
@group(0) @binding(2) var<storage, read> count_source: array<u32>;
@group(0) @binding(3) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> reference: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> state: SkinState;
#ifdef SPECIES
@group(0) @binding(6) var<storage, read> species: array<u32>;
@group(0) @binding(7) var<storage, read> reference_species: array<u32>;
@group(0) @binding(8) var<storage, read> species_params: array<vec2<u32>>;
#endif
#include effective_radius
#include displacement
#include wrapped_sphere
#include subgroup_max
#include inflated_radius

var<workgroup> group_moved: atomic<u32>;
var<workgroup> group_changed: atomic<u32>;

@compute @workgroup_size(256)
fn skin_displacement(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include thread_builtins
) {
#include thread_from_builtins
    let index = workgroup_index(id, groups) * 256u + thread.local_index;
    if (thread.local_index == 0u) {
        atomicStore(&group_moved, 0u);
        atomicStore(&group_changed, 0u);
    }
    workgroupBarrier();
    let count = min(count_source[0], params.spheres);
    var moved = 0u;
    if (index < count) {
        let now = spheres[index];
        let then = reference[index];
        let was_valid = then.w >= 0.0;
        var changed = is_valid(now) != was_valid;
        if (may_pair(index, now) && was_valid) {
            let difference = displacement(wrapped_sphere(now).xyz, then.xyz);
            moved = bitcast<u32>(dot(difference, difference));
            changed = bitcast<u32>(inflated_radius(now.w)) != bitcast<u32>(then.w) || now.w > LARGE;
        }
#ifdef SPECIES
        changed = changed || species[index] != reference_species[index];
#endif
        if (changed) {
            atomicStore(&group_changed, 1u);
        }
    }
    let farthest = max_in_subgroup(moved);
    if (is_leader(thread)) {
        atomicMax(&group_moved, farthest);
    }
    workgroupBarrier();
    if (thread.local_index == 0u) {
        let moved_most = atomicLoad(&group_moved);
        if (moved_most > atomicLoad(&state.displacement)) {
            atomicMax(&state.displacement, moved_most);
        }
        if (atomicLoad(&group_changed) != 0u) {
            atomicStore(&state.input_changed, 1u);
        }
    }
}
