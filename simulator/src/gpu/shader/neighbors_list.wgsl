// Reads the marks of neighbors_count.
#include control
#include near

@group(0) @binding(0) var<storage, read> near_pairs: array<vec2<u32>>;
@group(0) @binding(1) var<storage, read_write> window: Window;
@group(0) @binding(2) var<storage, read_write> next_events: array<Lists>;
@group(0) @binding(3) var<storage, read_write> neighbors: array<u32>;

fn list(at: u32, other: u32) {
    // Begin and count of NextEvent.
    let begin = atomicLoad(&next_events[at].words[5]);
    neighbors[begin + atomicAdd(&next_events[at].words[6], 1u)] = other;
}

@compute @workgroup_size(256)
fn neighbors_list(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local_index: u32) {
    let index = global_index(group, groups, local_index);
    if (index >= window.pairs) {
        return;
    }
    let pair = near_pairs[index];
    if (pair.y != NOTHING) {
        list(pair.x, pair.y);
        list(pair.y & ~PASSES, pair.x | (pair.y & PASSES));
    }
}
