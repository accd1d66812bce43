var<workgroup> partial: array<u32, 256>;
var<workgroup> group_frozen: u32;

// Whether the run stands still; the same for the whole workgroup, which takes part in sums as a whole or not at all.
fn stands_still(lane: u32) -> bool {
    if (lane == 0u) {
        group_frozen = control.frozen;
    }
    return workgroupUniformLoad(&group_frozen) != 0u;
}

// The sum of all values of a workgroup up to this lane's, its own included.
fn running_sum(value: u32, lane: u32) -> u32 {
    partial[lane] = value;
    workgroupBarrier();
    for (var distance = 1u; distance < GROUP; distance *= 2u) {
        var before = 0u;
        if (lane >= distance) {
            before = partial[lane - distance];
        }
        workgroupBarrier();
        partial[lane] += before;
        workgroupBarrier();
    }
    return partial[lane];
}
