// Moves particles by the mean displacement, unless that leads into a body.
#include control
#include params
#include boundary
#include event
#include push

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> trajectory: TrajectoryHeader;
@group(0) @binding(2) var<storage, read_write> control: Control;
@group(0) @binding(3) var<storage, read_write> moved: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> species: array<u32>;
@group(0) @binding(5) var<storage, read> species_rows: array<SpeciesRow>;
@group(0) @binding(6) var<storage, read> event_rows: array<EventRow>;
@group(0) @binding(7) var<storage, read> scene_rows: array<vec4<u32>>;
@group(0) @binding(8) var<storage, read_write> pushes: array<Push>;

#include receiver_cells

// Converts the magnitude, so that small negative numbers keep their digits.
fn value_of(low: u32, high: u32) -> f32 {
    if (high < 0x80000000u) {
        return f32(high) * 0x1p32 + f32(low);
    }
    let carry = select(0u, 1u, low == 0u);
    return -(f32(~high + carry) * 0x1p32 + f32(~low + 1u));
}

// True for a line from outside into a surface at the end of the step; see reflecting_spheres.rs.
fn enters_body(kind: SpeciesRow, before: vec3<f32>, to: vec3<f32>) -> bool {
    let by = minimum_image(to - before);
    let square = max(dot(by, by), 1e-37);
    let near_receivers = receivers_near(kind, to, sqrt(square));
    var is_entered = false;
    for (var k = near_receivers.begin; k < near_receivers.end; k++) {
        let event = event_rows[event_at(near_receivers, k)];
        let center = receiver_at(event.receiver, control.step + 1u).center;
        if (event.kind < REFLECTING || signed_distance(event.radius, center, before) < 0.0) {
            continue;
        }
        let start = minimum_image(before - center);
        let nearest = start + clamp(-dot(start, by) / square, 0.0, 1.0) * by;
        if (length(nearest) < event.radius || signed_distance(event.radius, center, to) < 0.0) {
            is_entered = true;
        }
    }
    return is_entered;
}

@compute @workgroup_size(256)
fn separation_move(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    if (at >= control.count) {
        return;
    }
    let count = atomicLoad(&pushes[at].count);
    if (count == 0u) {
        return;
    }
    let unit = 2.0 * params.largest_radius / (UNITS * f32(count));
    var by = vec3(0.0);
    for (var k = 0u; k < 3u; k++) {
        by = with_component(by, k, value_of(atomicLoad(&pushes[at].low[k]), atomicLoad(&pushes[at].high[k])) * unit);
        atomicStore(&pushes[at].low[k], 0u);
        atomicStore(&pushes[at].high[k], 0u);
    }
    atomicStore(&pushes[at].count, 0u);
    let sphere = moved[at];
    let to = confined(sphere.xyz + by, sphere.w);
    if (!enters_body(species_rows[species[at]], sphere.xyz, to)) {
        moved[at] = vec4(to, sphere.w);
    }
}
