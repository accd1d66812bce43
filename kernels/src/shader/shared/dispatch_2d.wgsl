const MAX_GROUPS: u32 = 65535u;

// One thread per pair. Neither dimension shrinks for more pairs.
fn consumer_groups(pairs: u32) -> vec2<u32> {
    let size = params.consumer_workgroup_size;
    return workgroups_2d(pairs / size + select(0u, 1u, pairs % size != 0u));
}

fn workgroups_2d(groups: u32) -> vec2<u32> {
    let rows = (groups + MAX_GROUPS - 1u) / MAX_GROUPS;
    return vec2(select(groups, MAX_GROUPS, rows > 1u), max(rows, 1u));
}
