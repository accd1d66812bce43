#ifdef SUBGROUPS
    let thread = Thread(local_invocation, subgroup_index, subgroup_count, subgroup_lane, subgroup_width);
#else
    let thread = Thread(local_invocation);
#endif
