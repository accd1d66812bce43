// Only the leader writes the maximum, because atomics on one address in workgroup memory serialize. Without subgroups,
// every thread leads itself. Called by whole subgroups; after a loop, no compiler can see that.
#ifdef SUBGROUPS
#standard @diagnostic(off, subgroup_uniformity)
fn max_in_subgroup(value: u32) -> u32 {
    return subgroupMax(value);
}

fn is_leader(thread: Thread) -> bool {
    return thread.lane == 0u;
}
#else
fn max_in_subgroup(value: u32) -> u32 {
    return value;
}

fn is_leader(thread: Thread) -> bool {
    return true;
}
#endif
