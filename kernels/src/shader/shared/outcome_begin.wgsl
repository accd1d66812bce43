// Clears what a call counts and says how many spheres it was given. `overflow` has what is known to be lacking already.
fn outcome_begin(overflow: u32, quarantined: u32) {
    let given = count_source[0];
    atomicStore(&outcome.found_lo, 0u);
    atomicStore(&outcome.found_hi, 0u);
    atomicStore(&outcome.overflow, overflow | select(0u, 4u, given > call.spheres));
    atomicStore(&outcome.quarantined, quarantined);
    atomicStore(&outcome.crowded, 0u);
    atomicStore(&outcome.crowded_tiles, 0u);
    atomicStore(&outcome.crowded_begin, 0u);
    atomicStore(&outcome.crowded_end, 0u);
    atomicStore(&outcome.entries_lo, 0u);
    atomicStore(&outcome.entries_hi, 0u);
    atomicStore(&outcome.spheres, given);
    atomicStore(&outcome.is_sorted, 0u);
}
