    @builtin(local_invocation_index) local_invocation: u32,
#ifdef SUBGROUPS
    @builtin(subgroup_id) subgroup_index: u32,
    @builtin(num_subgroups) subgroup_count: u32,
    @builtin(subgroup_invocation_id) subgroup_lane: u32,
    @builtin(subgroup_size) subgroup_width: u32,
#endif
