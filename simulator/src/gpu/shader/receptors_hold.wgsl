// Counts how many receptors of each receiver are taken.
#include control
#include fate_rows
#include receptor

@group(0) @binding(0) var<storage, read_write> control: Control;
@group(0) @binding(1) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> fates: array<Fate>;
@group(0) @binding(3) var<storage, read_write> receptors: array<Receptors>;

@compute @workgroup_size(256)
fn receptors_hold(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) lane: u32) {
    let at = place_of(group, groups, lane);
    if (at >= control.count) {
        return;
    }
    let sphere = spheres[at];
    if (sphere.w <= HELD) {
        atomicAdd(&receptors[fates[fate_of_held(sphere)].receiver].held, 1u);
    }
}
