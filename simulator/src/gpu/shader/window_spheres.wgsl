#include control
#include params
#include boundary
#include mover
#include window
#include tag

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> window: Window;
@group(0) @binding(2) var<storage, read> movers: array<Mover>;
@group(0) @binding(3) var<storage, read_write> next_events: array<NextEvent>;
@group(0) @binding(4) var<storage, read_write> inflated: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> species: array<u32>;

// See receiver.rs.
fn rounding(point: vec3<f32>, distance: f32) -> f32 {
    return 4e-6 * (abs(point.x) + abs(point.y) + abs(point.z) + distance);
}

@compute @workgroup_size(256)
fn window_spheres(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    if (at >= window.count) {
        return;
    }
    let mover = movers[at];
    let position = confined_axes(mover.base + mover.offset, 0.0);
    let radius = mover.radius + window.allowance;
    inflated[at] = vec4(position, select(-1.0, radius + rounding(position, radius), mover.radius >= 0.0));
    next_events[at].happens = 1u;
    next_events[at].count = 0u;
    // Further windows read the same species.
    if (window.now == 0.0) {
        species[at] = species_of(tags[at]);
    }
}
