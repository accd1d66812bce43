var<workgroup> partial: array<u32, 256>;

fn running_sum(value: u32, local_index: u32) -> u32 {
    partial[local_index] = value;
    workgroupBarrier();
    for (var distance = 1u; distance < WORKGROUP_SIZE; distance *= 2u) {
        var before = 0u;
        if (local_index >= distance) {
            before = partial[local_index - distance];
        }
        workgroupBarrier();
        partial[local_index] += before;
        workgroupBarrier();
    }
    return partial[local_index];
}
