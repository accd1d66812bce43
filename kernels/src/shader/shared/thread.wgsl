// Tint treats all members of a structure with a varying member as varying, so workgroup-uniform values are separate.
// Builtins are parameters, because naga 30 writes subgroup builtins in a structure to HLSL without semantics.
struct Thread {
    local_index: u32,
#ifdef SUBGROUPS
    subgroup: u32,
    subgroups: u32,
    lane: u32,
    subgroup_size: u32,
#endif
}

// A dimension has at most 65,535 workgroups.
fn workgroup_index(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.x + id.y * groups.x;
}
