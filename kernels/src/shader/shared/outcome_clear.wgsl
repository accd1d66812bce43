fn outcome_clear(given: u32) {
    atomicStore(&outcome.found_lo, 0u);
    atomicStore(&outcome.found_hi, 0u);
    atomicStore(&outcome.deferred_blocks, 0u);
    atomicStore(&outcome.deferred_max_tiles, 0u);
    atomicStore(&outcome.deferred_begin, 0u);
    atomicStore(&outcome.deferred_end, 0u);
    atomicStore(&outcome.entries_lo, 0u);
    atomicStore(&outcome.entries_hi, 0u);
    atomicStore(&outcome.spheres, given);
    atomicStore(&outcome.pairs_in_cell_order, 0u);
}
