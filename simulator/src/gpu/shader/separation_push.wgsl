// Sums displacements as integers; see contact.rs.
#include control
#include params
#include philox
#include normal
#include boundary
#include candidate
#include push

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> round: Round;
@group(0) @binding(2) var<storage, read_write> control: Control;
@group(0) @binding(3) var<storage, read> pairs: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> moved: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> species: array<u32>;
@group(0) @binding(6) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(8) var<storage, read> reaction_rows: array<ReactionRow>;
@group(0) @binding(9) var<storage, read_write> pushes: array<Push>;

#include round

fn push(at: u32, by: vec3<f32>) {
    let units = vec3<i32>(round_units(by));
    for (var k = 0u; k < 3u; k++) {
        let low = u32(units[k]);
        let carry = select(0u, 1u, atomicAdd(&pushes[at].low[k], low) + low < low);
        // The sign extends to the upper word.
        atomicAdd(&pushes[at].high[k], select(0u, 0xffffffffu, units[k] < 0) + carry);
    }
    atomicAdd(&pushes[at].count, 1u);
}

fn round_units(by: vec3<f32>) -> vec3<f32> {
    return floor(by / (2.0 * params.largest_radius) * UNITS + 0.5);
}

@compute @workgroup_size(256)
fn separation_push(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local_index: u32) {
    let index = global_index(group, groups, local_index);
    if (atomicLoad(&control.halted) != 0u || index >= control.pairs) {
        return;
    }
    var pair = pairs[index];
    if (tags[pair.x].y > tags[pair.y].y) {
        pair = pair.yx;
    }
    if (atomicLoad(&claims[pair.x].is_taken) != 0u || atomicLoad(&claims[pair.y].is_taken) != 0u) {
        return;
    }
    let rule = species[pair.x] * params.species + species[pair.y];
    if (may_react(reaction_rows[rule])) {
        return;
    }
    let a = moved[pair.x];
    let b = moved[pair.y];
    let touch = a.w + b.w;
    let d = minimum_image(b.xyz - a.xyz);
    let distance = length(d);
    let overlap = touch - distance;
    if (overlap <= 4e-6 * (abs(a.x) + abs(a.y) + abs(a.z) + touch)) {
        return;
    }
    var normal = d / max(distance, 1e-37);
    if (distance == 0.0) {
        let words = philox(vec4(tags[pair.x].y, tags[pair.y].y, control.step, PURPOSE_PAIR), params.key);
        normal = direction_within(direction(words.z, words.w));
    }
    let fraction = reaction_rows[rule].first_fraction;
    push(pair.x, -fraction * overlap * normal);
    push(pair.y, (1.0 - fraction) * overlap * normal);
    if (round.source == 0u) {
        atomicAdd(&control.contacts, 1u);
    }
}
