var<workgroup> partial: array<u32, 256>;

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
