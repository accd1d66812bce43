// Lists the pairs that chance lets react. Their order does not matter.
#include control
#include params
#include philox
#include boundary
#include candidate

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read> pairs: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> moved: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> species: array<u32>;
@group(0) @binding(5) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read> rules: array<Rule>;
@group(0) @binding(7) var<storage, read_write> candidates: array<Candidate>;
@group(0) @binding(8) var<storage, read_write> left: array<u32>;

@compute @workgroup_size(256)
fn candidates_draw(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) lane: u32) {
    let index = place_of(group, groups, lane);
    if (control.frozen != 0u || index >= control.pairs) {
        return;
    }
    let pair = pairs[index];
    let kinds = vec2(species[pair.x], species[pair.y]);
    let place = kinds.x * params.species + kinds.y;
    let rule = rules[place];
    if (rule.first == NOTHING) {
        return;
    }
    if ((rule.flags & 4u) != 0u) {
        let d = nearest(moved[pair.y].xyz - moved[pair.x].xyz);
        if (dot(d, d) > rule.within * rule.within) {
            return;
        }
    }
    let own = vec2(tags[pair.x].y, tags[pair.y].y);
    let words = philox(vec4(min(own.x, own.y), max(own.x, own.y), control.step, PURPOSE_PAIR), params.key);
    if (words.y > rule.up_to) {
        return;
    }
    // Among equals the lower id comes first.
    let in_order = select(kinds.x == rule.first, own.x < own.y, kinds.x == kinds.y);
    let slot = atomicAdd(&control.left[0], 1u);
    candidates[slot] =
        Candidate(select(pair.yx, pair, in_order), select(own.yx, own, in_order), place, words.x);
    left[slot] = slot;
}
