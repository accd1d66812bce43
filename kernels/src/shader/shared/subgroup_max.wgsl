// The largest of what the threads of a subgroup have, which one of them passes on: atomics of one address in workgroup
// memory wait for each other. Without subgroups each passes its own on. Called by whole subgroups; behind a loop no compiler
// knows that.
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
