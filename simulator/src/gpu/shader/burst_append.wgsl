// Appends a burst. A repeated step appends it again.
#include control
#include params

struct Burst {
    count: u32,
}

@group(0) @binding(0) var<uniform> burst: Burst;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read> burst_spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> burst_tags: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> spheres: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> tags: array<vec2<u32>>;
@group(0) @binding(6) var<uniform> params: Params;

#include velocity_index

@compute @workgroup_size(256)
fn burst_append(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local_index: u32) {
    let k = global_index(group, groups, local_index);
    if (atomicLoad(&control.halted) != 0u || k >= burst.count) {
        return;
    }
    let at = control.alive + k;
    spheres[at] = burst_spheres[k];
    if (params.has_velocity != 0u) {
        spheres[velocity_at(at)] = burst_spheres[burst.count + k];
    }
    tags[at] = burst_tags[k];
    if (k == 0u) {
        control.incoming = burst.count;
    }
}
