// Counts the neighbors of each particle.
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
        atomicAdd(&next_events[pair.x].words[6], 1u);
        atomicAdd(&next_events[pair.y].words[6], 1u);
    }
}
