// Counts neighbors and marks pairs: another kernel could round gaps differently.
#include control
#include params
#include boundary
#include candidate
#include near
#include tag

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> near_pairs: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> movers: array<Mover>;
@group(0) @binding(3) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> reaction_rows: array<ReactionRow>;
@group(0) @binding(5) var<storage, read_write> window: Window;
@group(0) @binding(6) var<storage, read_write> next_events: array<Lists>;

#include gap

// Returns 0 for neighbors, PASSES if they overlap and may bounce, or NOTHING.
fn mark_of(pair: vec2<u32>) -> u32 {
    let a = movers[pair.x];
    let b = movers[pair.y];
    let touch = a.radius + b.radius;
    let gap = gap_at(a, b, window.now);
    if (touch <= 0.0 || gap > 2.0 * window.allowance) {
        return NOTHING;
    }
    var position = b.base + b.offset;
    if (a.id < b.id) {
        position = a.base + a.offset;
    }
    if (may_react(reaction_rows[species_of(tags[pair.x]) * params.species + species_of(tags[pair.y])])) {
        return NOTHING;
    }
    if (!(-gap > 4e-6 * (abs(position.x) + abs(position.y) + abs(position.z) + touch))) {
        return 0u;
    }
    return select(NOTHING, PASSES, params.is_elastic != 0u && window.now == 0.0);
}

@compute @workgroup_size(256)
fn neighbors_count(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local_index: u32) {
    let index = global_index(group, groups, local_index);
    if (index >= window.pairs) {
        return;
    }
    let pair = near_pairs[index];
    let mark = mark_of(pair);
    near_pairs[index].y = pair.y | mark;
    if (mark != NOTHING) {
        atomicAdd(&next_events[pair.x].words[6], 1u);
        atomicAdd(&next_events[pair.y].words[6], 1u);
    }
}
