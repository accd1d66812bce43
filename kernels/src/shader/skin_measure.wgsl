// How far the farthest sphere has gone since the candidates were found, and whether some sphere is another one.
#include layout
#include place
#include sphere
#include skin

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<uniform> skin: Skin;
@group(0) @binding(2) var<storage, read> count_source: array<u32>;
@group(0) @binding(3) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> kept: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> state: SkinState;
#ifdef SPECIES
@group(0) @binding(6) var<storage, read> species: array<u32>;
@group(0) @binding(7) var<storage, read> kept_species: array<u32>;
#endif
#include between
#include image
#include subgroup_max
#include widened

var<workgroup> group_moved: atomic<u32>;
var<workgroup> group_changed: atomic<u32>;

@compute @workgroup_size(256)
fn skin_measure(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
#include place_builtins
) {
#include place_from_builtins
    let index = number_of_group(id, groups) * 256u + place.lane;
    if (place.lane == 0u) {
        atomicStore(&group_moved, 0u);
        atomicStore(&group_changed, 0u);
    }
    workgroupBarrier();
    let count = min(count_source[0], call.spheres);
    var moved = 0u;
    if (index < count) {
        let now = spheres[index];
        let then = kept[index];
        let was_valid = then.w >= 0.0;
        var changed = is_valid(now) != was_valid;
        if (is_valid(now) && was_valid) {
            let gone = between(image_of(now).xyz, then.xyz);
            moved = bitcast<u32>(dot(gone, gone));
            changed = bitcast<u32>(widened(now.w)) != bitcast<u32>(then.w) || now.w > LARGE;
        }
#ifdef SPECIES
        changed = changed || species[index] != kept_species[index];
#endif
        if (changed) {
            atomicStore(&group_changed, 1u);
        }
    }
    let farthest = largest_in_subgroup(moved);
    if (passes_on(place)) {
        atomicMax(&group_moved, farthest);
    }
    workgroupBarrier();
    if (place.lane == 0u) {
        let moved_most = atomicLoad(&group_moved);
        if (moved_most > atomicLoad(&state.moved)) {
            atomicMax(&state.moved, moved_most);
        }
        if (atomicLoad(&group_changed) != 0u) {
            atomicStore(&state.changed, 1u);
        }
    }
}
