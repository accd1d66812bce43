#include control
#include window

@group(0) @binding(0) var<storage, read_write> control: Control;
@group(0) @binding(1) var<storage, read_write> window: Window;
@group(0) @binding(2) var<storage, read_write> near_outcome: array<atomic<u32>>;

@compute @workgroup_size(1)
fn candidates_check() {
    if (window.count == 0u) {
        return;
    }
    let overflow = atomicLoad(&near_outcome[2]);
    window.pairs = atomicLoad(&near_outcome[0]);
    if (overflow == 0u) {
        return;
    }
    window.count = 0u;
    window.pairs = 0u;
    var reason = CANDIDATE_OVERFLOW;
    control.missing_lo = atomicLoad(&near_outcome[0]);
    control.missing_hi = atomicLoad(&near_outcome[1]);
    if ((overflow & 2u) != 0u) {
        reason = ENTRY_OVERFLOW;
        control.missing_lo = atomicLoad(&near_outcome[8]);
        control.missing_hi = atomicLoad(&near_outcome[9]);
    } else if ((overflow & 16u) != 0u) {
        reason = UNFINISHED_SEARCH;
        control.missing_lo = atomicLoad(&near_outcome[7]);
        control.missing_hi = atomicLoad(&near_outcome[11]);
    }
    atomicStore(&control.halted, reason);
}
