#include control
#include event_rows
#include receptor

@group(0) @binding(0) var<storage, read_write> control: Control;
@group(0) @binding(1) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> event_rows: array<EventRow>;
@group(0) @binding(3) var<storage, read_write> receptors: array<Receptors>;

@compute @workgroup_size(256)
fn receptors_count_bound(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    if (at >= control.count) {
        return;
    }
    let sphere = spheres[at];
    if (sphere.w <= BOUND_RADIUS) {
        atomicAdd(&receptors[event_rows[ligand_of_bound(sphere)].receptor].bound, 1u);
    }
}
