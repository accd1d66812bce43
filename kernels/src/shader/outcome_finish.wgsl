// Settles the overflow flag and the indirect-dispatch arguments for the consumer of the pairs.
#include layout

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read_write> outcome: Outcome;
#include rows

@compute @workgroup_size(1)
fn outcome_finish() {
    if (call.further_shares != 0u) {
        // All were dispatched.
        atomicStore(&outcome.crowded_end, atomicLoad(&outcome.crowded));
    }
    let found = atomicLoad(&outcome.found_lo);
    let full = atomicLoad(&outcome.found_hi) != 0u || found > call.pair_capacity;
    if (full) {
        atomicOr(&outcome.overflow, 1u);
    }
    let written = select(found, call.pair_capacity, full);
    let groups =
        in_rows(written / call.consumer_group + select(0u, 1u, written % call.consumer_group != 0u));
    atomicStore(&outcome.dispatch_x, groups.x);
    atomicStore(&outcome.dispatch_y, groups.y);
    atomicStore(&outcome.dispatch_z, 1u);
}
