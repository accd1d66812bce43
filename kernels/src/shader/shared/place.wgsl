// Where a thread stands in its workgroup. What is the same for the whole workgroup is passed beside it: as members of
// one structure compilers would take all of it to differ from thread to thread, and refuse barriers behind a branch.
struct Place {
    @builtin(local_invocation_index) lane: u32,
#ifdef SUBGROUPS
    @builtin(subgroup_id) subgroup: u32,
    @builtin(num_subgroups) subgroups: u32,
    @builtin(subgroup_invocation_id) lane_in_subgroup: u32,
    @builtin(subgroup_size) subgroup_size: u32,
#endif
}

// Workgroups are numbered over two dimensions, as one holds no more than 65 535 of them.
fn number_of_group(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.x + id.y * groups.x;
}
