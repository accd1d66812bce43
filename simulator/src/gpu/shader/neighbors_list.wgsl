// Lists the neighbors of each particle.
#include near

@group(0) @binding(7) var<storage, read_write> neighbors: array<u32>;

fn list(at: u32, other: u32) {
    // The begin and count of NextEvent.
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
    let mark = mark_of(pair);
    if (mark != NOTHING) {
        list(pair.x, pair.y | mark);
        list(pair.y, pair.x | mark);
    }
}
