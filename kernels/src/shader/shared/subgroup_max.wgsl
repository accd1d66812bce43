// Only the leader writes the maximum, because atomics on one address in workgroup memory serialize. Whole subgroups
// call both functions, but after a loop no interface promises it. So the first active thread leads.
#ifdef SUBGROUPS
#standard @diagnostic(off, subgroup_uniformity)
fn max_in_subgroup(value: u32) -> u32 {
    return subgroupMax(value);
}

#standard @diagnostic(off, subgroup_uniformity)
fn is_leader(thread: Thread) -> bool {
    return thread.lane == subgroupBroadcastFirst(thread.lane);
}
#else
fn max_in_subgroup(value: u32) -> u32 {
    return value;
}

fn is_leader(thread: Thread) -> bool {
    return true;
}
#endif
