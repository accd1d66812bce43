#include pairs

#ifdef SUBGROUPS
// Whether any thread of the subgroup has something to write; keeps the subgroup together in `pairs_reserve_by_subgroup`.
fn any_in_subgroup(wanted: bool) -> bool {
    return subgroupAny(wanted);
}

// Places for this thread's `count` pairs, without a workgroup barrier: one atomic per subgroup. Called behind
// `any_in_subgroup`, which is the same for all its threads; no compiler knows that yet.
#standard @diagnostic(off, subgroup_uniformity)
fn pairs_reserve_by_subgroup(count: u32, thread: Thread) -> u32 {
    let before = subgroupExclusiveAdd(count);
    let total = subgroupAdd(count);
    var first = 0u;
    if (thread.lane == 0u) {
        first = found_reserve(total);
    }
    first = subgroupBroadcastFirst(first);
    return select(0xffffffffu, first + before, first < params.pair_capacity);
}
#else
fn any_in_subgroup(wanted: bool) -> bool {
    return wanted;
}

// Places for this thread's `count` pairs, without a workgroup barrier.
fn pairs_reserve_by_subgroup(count: u32, thread: Thread) -> u32 {
    return found_reserve(count);
}
#endif
