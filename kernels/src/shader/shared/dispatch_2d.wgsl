const MAX_GROUPS: u32 = 65535u;

fn workgroups_2d(groups: u32) -> vec2<u32> {
    let rows = (groups + MAX_GROUPS - 1u) / MAX_GROUPS;
    return vec2(select(groups, MAX_GROUPS, rows > 1u), max(rows, 1u));
}
