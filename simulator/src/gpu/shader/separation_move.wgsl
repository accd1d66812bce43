// Moves particles by the mean displacement of their overlaps.
#include control
#include params
#include boundary
#include push

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read_write> moved: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> pushes: array<Push>;

// Converts a signed number of two words by its magnitude, so that small negative ones keep their digits.
fn value_of(low: u32, high: u32) -> f32 {
    if (high < 0x80000000u) {
        return f32(high) * 0x1p32 + f32(low);
    }
    let carry = select(0u, 1u, low == 0u);
    return -(f32(~high + carry) * 0x1p32 + f32(~low + 1u));
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
        by[k] = value_of(atomicLoad(&pushes[at].low[k]), atomicLoad(&pushes[at].high[k])) * unit;
        atomicStore(&pushes[at].low[k], 0u);
        atomicStore(&pushes[at].high[k], 0u);
    }
    atomicStore(&pushes[at].count, 0u);
    let sphere = moved[at];
    moved[at] = vec4(confined(sphere.xyz + by, sphere.w), sphere.w);
}
