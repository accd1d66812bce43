// Halts the run if the search failed.
#include control
#include params

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read_write> outcome: array<atomic<u32>>;

@compute @workgroup_size(1)
fn detector_check() {
    if (atomicLoad(&control.halted) != 0u) {
        return;
    }
    let overflow = atomicLoad(&outcome[2]);
    let astray = atomicLoad(&outcome[3]) - atomicLoad(&control.removed);
    control.found_lo = atomicLoad(&outcome[0]);
    control.found_hi = atomicLoad(&outcome[1]);
    if ((overflow & 2u) != 0u) {
        atomicStore(&control.halted, ENTRY_OVERFLOW);
        control.missing_lo = atomicLoad(&outcome[8]);
        control.missing_hi = atomicLoad(&outcome[9]);
    } else if (astray != 0u) {
        atomicStore(&control.halted, NOT_FINITE);
        control.missing_lo = astray;
        control.missing_hi = 0u;
    } else if ((overflow & 16u) != 0u) {
        atomicStore(&control.halted, UNFINISHED_SEARCH);
        control.missing_lo = atomicLoad(&outcome[7]);
        control.missing_hi = atomicLoad(&outcome[11]);
    } else if (overflow != 0u && params.lists_pairs != 0u) {
        atomicStore(&control.halted, PAIR_OVERFLOW);
        control.missing_lo = control.found_lo;
        control.missing_hi = control.found_hi;
    } else {
        control.pairs = select(0u, control.found_lo, params.lists_pairs != 0u);
    }
}
