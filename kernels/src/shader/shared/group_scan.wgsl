const GROUP: u32 = 256u;

#ifdef SUBGROUPS
var<workgroup> group_sums: array<u32, #{MAX_SUBGROUPS}>;
var<workgroup> group_total: u32;

// Exclusive prefix sum of `value` over the workgroup in x, the sum of all in y. Called by all threads.
fn group_scan(value: u32, place: Place) -> vec2<u32> {
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
    let result = vec2(before + group_sums[place.subgroup], group_total);
    workgroupBarrier();
    return result;
}
#else
var<workgroup> group_sums: array<u32, 512>;

// Exclusive prefix sum of `value` over the workgroup in x, the sum of all in y. Called by all threads.
fn group_scan(value: u32, place: Place) -> vec2<u32> {
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
    let result = vec2(group_sums[front + place.lane] - value, group_sums[front + GROUP - 1u]);
    workgroupBarrier();
    return result;
}
#endif
