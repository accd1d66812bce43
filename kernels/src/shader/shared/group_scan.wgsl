const GROUP: u32 = 256u;

// Kept apart from the partial sums, which the next scan begins to write while some threads may still ask for this.
var<workgroup> group_total: u32;

fn group_sum() -> u32 {
    return group_total;
}

#ifdef SUBGROUPS
var<workgroup> group_sums: array<u32, #{MAX_SUBGROUPS}>;

// Exclusive prefix sum of `value` over the workgroup; `group_sum` is the sum of all from then on until the next scan.
// Called by all threads.
fn group_scan(value: u32, place: Place) -> u32 {
    let before = subgroupExclusiveAdd(value);
    let sum = subgroupAdd(value);
    if (place.lane_in_subgroup == 0u) {
        group_sums[place.subgroup] = sum;
    }
    workgroupBarrier();
    if (place.lane == 0u) {
        var running = 0u;
        for (var s = 0u; s < place.subgroups; s++) {
            let next = group_sums[s];
            group_sums[s] = running;
            running += next;
        }
        group_total = running;
    }
    workgroupBarrier();
    let prefix = before + group_sums[place.subgroup];
    workgroupBarrier();
    return prefix;
}
#else
var<workgroup> group_sums: array<u32, 512>;

// Exclusive prefix sum of `value` over the workgroup; `group_sum` is the sum of all from then on until the next scan.
// Called by all threads.
fn group_scan(value: u32, place: Place) -> u32 {
    var front = 0u;
    group_sums[place.lane] = value;
    workgroupBarrier();
    for (var step = 1u; step < GROUP; step *= 2u) {
        var sum = group_sums[front + place.lane];
        if (place.lane >= step) {
            sum += group_sums[front + place.lane - step];
        }
        front = GROUP - front;
        group_sums[front + place.lane] = sum;
        workgroupBarrier();
    }
    let through = group_sums[front + place.lane];
    if (place.lane == GROUP - 1u) {
        group_total = through;
    }
    workgroupBarrier();
    return through - value;
}
#endif
