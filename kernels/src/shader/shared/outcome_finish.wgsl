#include layout

@group(0) @binding(0) var<uniform> params: SearchParams;
@group(0) @binding(1) var<storage, read_write> outcome: Outcome;
#include dispatch_2d

const OVERFLOW_WORK: u32 = 16u;

@compute @workgroup_size(1)
fn outcome_finish() {
    let found = atomicLoad(&outcome.found_lo);
    let full = atomicLoad(&outcome.found_hi) != 0u || found > params.pair_capacity;
    // A continuation clears the bit of its predecessor.
    let remains = atomicLoad(&outcome.deferred_end) < atomicLoad(&outcome.deferred_blocks);
    let others = atomicLoad(&outcome.overflow) & ~OVERFLOW_WORK;
    atomicStore(&outcome.overflow, others | select(0u, 1u, full) | select(0u, OVERFLOW_WORK, remains));
    let written = select(found, params.pair_capacity, full);
    let groups = consumer_groups(written);
    atomicStore(&outcome.dispatch_x, groups.x);
    atomicStore(&outcome.dispatch_y, groups.y);
    atomicStore(&outcome.dispatch_z, 1u);
}
