// Begins a step of receptors: none is known to be taken, and nobody has come.
#include control
#include receptor

@group(0) @binding(0) var<storage, read_write> receptors: array<Receptors>;

@compute @workgroup_size(256)
fn receptors_begin(@builtin(local_invocation_index) lane: u32) {
    let count = arrayLength(&receptors);
    for (var turn = 0u; turn < count / GROUP + 1u; turn++) {
        let k = turn * GROUP + lane;
        if (k < count) {
            atomicStore(&receptors[k].held, 0u);
            atomicStore(&receptors[k].bids, 0u);
        }
    }
}
