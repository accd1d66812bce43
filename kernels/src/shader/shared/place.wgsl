// Where a thread stands: its workgroup in the flattened dispatch, and its lane.
struct Place {
    group: u32,
    lane: u32,
#ifdef SUBGROUPS
    subgroup: u32,
    subgroups: u32,
    lane_in_subgroup: u32,
    subgroup_size: u32,
#endif
}

struct Builtins {
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
#ifdef SUBGROUPS
    @builtin(subgroup_id) subgroup: u32,
    @builtin(num_subgroups) subgroups: u32,
    @builtin(subgroup_invocation_id) lane_in_subgroup: u32,
    @builtin(subgroup_size) subgroup_size: u32,
#endif
}

// Workgroups are numbered over two dimensions, as one holds no more than 65 535 of them.
fn place_of(at: Builtins) -> Place {
    var place: Place;
    place.group = at.group.x + at.group.y * at.groups.x;
    place.lane = at.lane;
#ifdef SUBGROUPS
    place.subgroup = at.subgroup;
    place.subgroups = at.subgroups;
    place.lane_in_subgroup = at.lane_in_subgroup;
    place.subgroup_size = at.subgroup_size;
#endif
    return place;
}
