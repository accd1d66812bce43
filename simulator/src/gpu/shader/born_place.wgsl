#include control
#include params
#include born

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read> born: array<Born>;
@group(0) @binding(3) var<storage, read> born_keys0: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> spheres: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> tags: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> events: array<vec4<u32>>;

#include velocity_index

@compute @workgroup_size(256)
fn born_place(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local_index: u32) {
    let k = global_index(group, groups, local_index);
    if (k >= atomicLoad(&control.born) || atomicLoad(&control.halted) != 0u) {
        return;
    }
    let key = born_keys0[k];
    let particle = born[key.y];
    let to = control.born_at + k;
    spheres[to] = particle.sphere;
    tags[to] = vec2(particle.species, control.born_id + k);
    if (params.has_velocity != 0u) {
        spheres[velocity_at(to)] = vec4(particle.velocity, 0.0);
    }
    if (params.logs_arrivals != 0u) {
        events[control.born_event + k] = vec4(control.step, NOTHING, k, key.x);
    }
}
