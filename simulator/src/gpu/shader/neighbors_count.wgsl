// Counts the neighbors of each particle.
#include control
#include params
#include boundary
#include candidate
#include window

struct Counts {
    words: array<atomic<u32>, 7>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> near_pairs: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> movers: array<Mover>;
@group(0) @binding(3) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> reaction_rows: array<ReactionRow>;
@group(0) @binding(5) var<storage, read_write> window: Window;
@group(0) @binding(6) var<storage, read_write> next_events: array<Counts>;

#include gap
#include near

@compute @workgroup_size(256)
fn neighbors_count(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local_index: u32) {
    let index = global_index(group, groups, local_index);
    if (index >= window.pairs) {
        return;
    }
    let pair = near_pairs[index];
    if (mark_of(pair) != NOTHING) {
        // The count of NextEvent.
        atomicAdd(&next_events[pair.x].words[6], 1u);
        atomicAdd(&next_events[pair.y].words[6], 1u);
    }
}
