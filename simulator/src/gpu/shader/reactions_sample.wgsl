#include control
#include params
#include philox
#include boundary
#include candidate
#include tag

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read> pairs: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> moved: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> species: array<u32>;
@group(0) @binding(5) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read> reaction_rows: array<ReactionRow>;
@group(0) @binding(7) var<storage, read_write> candidates: array<Candidate>;
@group(0) @binding(8) var<storage, read_write> left: array<u32>;

// Particles that dissociate do not exist when pairs react; see dissociation.rs.
fn dissociates(first_row: ReactionRow, side: u32, tag: vec2<u32>) -> bool {
    if ((first_row.flags & (32u << side)) == 0u || (tag.x & SPARED) != 0u) {
        return false;
    }
    let words = philox(vec4(tag.y, 0u, control.step, PURPOSE_DISSOCIATION), params.key);
    return words.x <= first_row.dissociation_thresholds[side];
}

@compute @workgroup_size(256)
fn reactions_sample(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local_index: u32) {
    let index = global_index(group, groups, local_index);
    if (atomicLoad(&control.halted) != 0u || index >= control.pairs) {
        return;
    }
    let pair = pairs[index];
    let kinds = vec2(species[pair.x], species[pair.y]);
    let first_row = kinds.x * params.species + kinds.y;
    var row = first_row;
    if (reaction_rows[row].first == NOTHING) {
        return;
    }
    let d = minimum_image(moved[pair.y].xyz - moved[pair.x].xyz);
    let apart = dot(d, d);
    let own = vec2(tags[pair.x].y, tags[pair.y].y);
    let words = philox(vec4(min(own.x, own.y), max(own.x, own.y), control.step, PURPOSE_PAIR), params.key);
    // The innermost shell, then its drawn reaction.
    for (var k = 0u; k < arrayLength(&reaction_rows); k++) {
        if (row == NOTHING) {
            break;
        }
        let rule = reaction_rows[row];
        if ((rule.flags & 4u) != 0u && apart > rule.within * rule.within) {
            row = rule.next_shell;
        } else if (words.y > rule.threshold) {
            row = rule.next;
        } else {
            break;
        }
    }
    if (row == NOTHING) {
        return;
    }
    if (dissociates(reaction_rows[first_row], 0u, tags[pair.x]) || dissociates(reaction_rows[first_row], 1u, tags[pair.y])) {
        return;
    }
    let rule = reaction_rows[row];
    // The lower id of equal reactants is first, unless the order is drawn; see candidates.rs.
    let lower_first = (rule.flags & 128u) == 0u || (words.w & 1u) == 0u;
    let in_order = select(kinds.x == rule.first, (own.x < own.y) == lower_first, kinds.x == kinds.y);
    let slot = atomicAdd(&control.left[0], 1u);
    candidates[slot] =
        Candidate(select(pair.yx, pair, in_order), select(own.yx, own, in_order), row, words.x);
    left[slot] = slot;
}
