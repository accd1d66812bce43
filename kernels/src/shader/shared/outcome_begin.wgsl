#include outcome_clear

fn outcome_begin(overflow: u32, quarantined: u32) {
    let given = count_source[0];
    atomicStore(&outcome.overflow, overflow | select(0u, 4u, given > params.spheres));
    atomicStore(&outcome.quarantined, quarantined);
    outcome_clear(given);
}
