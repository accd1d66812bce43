// Writes the ends of paths. Halts the run if the step is not over.
#include control
#include params
#include boundary
#include mover
#include window

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read_write> window: Window;
@group(0) @binding(3) var<storage, read> movers: array<Mover>;
@group(0) @binding(4) var<storage, read> next_events: array<NextEvent>;
@group(0) @binding(5) var<storage, read_write> moved: array<vec4<f32>>;

@compute @workgroup_size(256)
fn collisions_land(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    if (at >= control.count) {
        return;
    }
    if (at == 0u && window.horizon < 1.0 && atomicLoad(&control.halted) == 0u) {
        atomicOr(&control.halted, WINDOWS_LEFT);
    }
    let mover = movers[at];
    moved[at] = vec4(mover.base + mover.offset, f32(next_events[at].collided));
    if (params.has_velocity != 0u) {
        moved[arrayLength(&moved) / 2u + at] = vec4(mover.own, 0.0);
    }
}
