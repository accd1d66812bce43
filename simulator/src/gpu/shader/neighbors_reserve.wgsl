#include control
#include mover
#include window

@group(0) @binding(0) var<storage, read_write> control: Control;
@group(0) @binding(1) var<storage, read_write> window: Window;
@group(0) @binding(2) var<storage, read_write> next_events: array<NextEvent>;

#include running_sum

// Loops over more would not end on software drivers.
const MAX_NEIGHBORS: u32 = 50000u;

var<workgroup> first: u32;

@compute @workgroup_size(256)
fn neighbors_reserve(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                     @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    let exists = at < window.count;
    var count = 0u;
    if (exists) {
        count = next_events[at].count;
    }
    let through = running_sum(count, local_index);
    if (local_index == WORKGROUP_SIZE - 1u) {
        first = atomicAdd(&window.listed, through);
    }
    workgroupBarrier();
    if (!exists) {
        return;
    }
    next_events[at].begin = first + through - count;
    next_events[at].count = 0u;
    if (count > MAX_NEIGHBORS) {
        atomicOr(&control.halted, TOO_MANY_NEIGHBORS);
    }
}
