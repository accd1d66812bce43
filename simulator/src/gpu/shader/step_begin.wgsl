// Steps of a halted run have no particles.
#include control
#include params

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;

@compute @workgroup_size(256)
fn step_begin(@builtin(local_invocation_index) local_index: u32) {
    for (var iteration = 0u; iteration < params.tallies / WORKGROUP_SIZE + 1u; iteration++) {
        let k = iteration * WORKGROUP_SIZE + local_index;
        if (k < params.tallies) {
            atomicStore(&control.tallies[k], 0u);
        }
    }
    if (local_index != 0u) {
        return;
    }
    control.count = select(0u, control.alive + control.incoming, atomicLoad(&control.halted) == 0u);
    control.incoming = 0u;
    control.step = control.done;
    control.pairs = 0u;
    control.found_lo = 0u;
    control.found_hi = 0u;
    atomicStore(&control.born, 0u);
    atomicStore(&control.events, control.committed_events);
    atomicStore(&control.removed, 0u);
    atomicStore(&control.contacts, 0u);
    atomicStore(&control.left[0], 0u);
    atomicStore(&control.left[1], 0u);
}
