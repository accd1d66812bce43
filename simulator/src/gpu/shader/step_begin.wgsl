// Begins a step: how many particles it has, and nothing counted yet. A frozen run has steps without particles.
#include control
#include params

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;

@compute @workgroup_size(256)
fn step_begin(@builtin(local_invocation_index) lane: u32) {
    for (var turn = 0u; turn < params.tallies / GROUP + 1u; turn++) {
        let k = turn * GROUP + lane;
        if (k < params.tallies) {
            atomicStore(&control.tallies[k], 0u);
        }
    }
    if (lane != 0u) {
        return;
    }
    control.count = select(0u, control.alive + control.incoming, control.frozen == 0u);
    control.incoming = 0u;
    control.step = control.done;
    control.pairs = 0u;
    control.found_lo = 0u;
    control.found_hi = 0u;
    atomicStore(&control.gone, 0u);
    atomicStore(&control.left[0], 0u);
    atomicStore(&control.left[1], 0u);
}
