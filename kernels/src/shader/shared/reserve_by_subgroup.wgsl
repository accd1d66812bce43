#include pairs

#ifdef SUBGROUPS
fn any_in_subgroup(wanted: bool) -> bool {
    return subgroupAny(wanted);
}

// Callers branch on `any_in_subgroup`, whose uniformity no compiler can prove. The first active thread reserves,
// because no interface promises that a subgroup converges after a diverged loop.
#standard @diagnostic(off, subgroup_uniformity)
fn pairs_reserve_by_subgroup(count: u32, thread: Thread) -> u32 {
    let before = subgroupExclusiveAdd(count);
    let total = subgroupAdd(count);
    var first = 0u;
    if (thread.lane == subgroupBroadcastFirst(thread.lane)) {
        first = found_reserve(total);
    }
    first = subgroupBroadcastFirst(first);
    return select(0xffffffffu, first + before, first < params.pair_capacity);
}
#else
fn any_in_subgroup(wanted: bool) -> bool {
    return wanted;
}

fn pairs_reserve_by_subgroup(count: u32, thread: Thread) -> u32 {
    return found_reserve(count);
}
#endif
