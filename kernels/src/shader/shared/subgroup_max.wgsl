// The largest of what the threads of a subgroup have, which one of them passes on: atomics of one address in workgroup
// memory wait for each other. Without subgroups each passes its own on. Called by whole subgroups; behind a loop no compiler
// knows that.
#ifdef SUBGROUPS
#standard @diagnostic(off, subgroup_uniformity)
fn largest_in_subgroup(value: u32) -> u32 {
    return subgroupMax(value);
}

fn passes_on(place: Place) -> bool {
    return place.lane_in_subgroup == 0u;
}
#else
fn largest_in_subgroup(value: u32) -> u32 {
    return value;
}

fn passes_on(place: Place) -> bool {
    return true;
}
#endif
