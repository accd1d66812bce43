// The most workgroups in one dimension of a dispatch (WebGPU's default limit).
const MAX_GROUPS: u32 = 65535u;

// Returns the first two dimensions of a dispatch of at least `groups` workgroups.
fn workgroups_2d(groups: u32) -> vec2<u32> {
    let rows = (groups + MAX_GROUPS - 1u) / MAX_GROUPS;
    return vec2(select(groups, MAX_GROUPS, rows > 1u), max(rows, 1u));
}
