const WORKGROUP_SIZE: u32 = 256u;

// Separate from the partial sums, which the next scan may write while threads still read the total.
var<workgroup> group_total: u32;

fn workgroup_sum() -> u32 {
    return group_total;
}

#ifdef SUBGROUPS
var<workgroup> group_sums: array<u32, #{MAX_SUBGROUPS}>;

// Returns the exclusive prefix sum. All threads must call it. `workgroup_sum` returns the total until the next scan.
fn workgroup_scan(value: u32, thread: Thread) -> u32 {
    let before = subgroupExclusiveAdd(value);
    let sum = subgroupAdd(value);
    if (thread.lane == 0u) {
        group_sums[thread.subgroup] = sum;
    }
    workgroupBarrier();
    if (thread.local_index == 0u) {
        var running = 0u;
        for (var s = 0u; s < thread.subgroups; s++) {
            let next = group_sums[s];
            group_sums[s] = running;
            running += next;
        }
        group_total = running;
    }
    workgroupBarrier();
    let prefix = before + group_sums[thread.subgroup];
    workgroupBarrier();
    return prefix;
}
#else
var<workgroup> group_sums: array<u32, 512>;

fn workgroup_scan(value: u32, thread: Thread) -> u32 {
    var front = 0u;
    group_sums[thread.local_index] = value;
    workgroupBarrier();
    for (var step = 1u; step < WORKGROUP_SIZE; step *= 2u) {
        var sum = group_sums[front + thread.local_index];
        if (thread.local_index >= step) {
            sum += group_sums[front + thread.local_index - step];
        }
        front = WORKGROUP_SIZE - front;
        group_sums[front + thread.local_index] = sum;
        workgroupBarrier();
    }
    let through = group_sums[front + thread.local_index];
    if (thread.local_index == WORKGROUP_SIZE - 1u) {
        group_total = through;
    }
    workgroupBarrier();
    return through - value;
}
#endif
