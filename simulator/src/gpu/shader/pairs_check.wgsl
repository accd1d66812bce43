// Takes over what the detector found. Where it could not do all of its work the run freezes, before anything of this
// step has touched the particles.
#include control
#include params

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read_write> outcome: array<atomic<u32>>;

@compute @workgroup_size(1)
fn pairs_check() {
    if (control.frozen != 0u) {
        return;
    }
    let overflow = atomicLoad(&outcome[2]);
    let astray = atomicLoad(&outcome[3]) - atomicLoad(&control.gone);
    control.found_lo = atomicLoad(&outcome[0]);
    control.found_hi = atomicLoad(&outcome[1]);
    if ((overflow & 2u) != 0u) {
        control.frozen = NO_ROOM_FOR_ENTRIES;
        control.lacking_lo = atomicLoad(&outcome[8]);
        control.lacking_hi = atomicLoad(&outcome[9]);
    } else if (astray != 0u) {
        control.frozen = NOT_FINITE;
        control.lacking_lo = astray;
        control.lacking_hi = 0u;
    } else if (overflow != 0u && params.lists_pairs != 0u) {
        control.frozen = NO_ROOM_FOR_PAIRS;
        control.lacking_lo = control.found_lo;
        control.lacking_hi = control.found_hi;
    } else {
        control.pairs = select(0u, control.found_lo, params.lists_pairs != 0u);
    }
}
