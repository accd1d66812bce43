#include control
#include receptor

@group(0) @binding(0) var<storage, read_write> receptors: array<Receptors>;

@compute @workgroup_size(256)
fn receptors_reset(@builtin(local_invocation_index) local_index: u32) {
    let count = arrayLength(&receptors);
    for (var iteration = 0u; iteration < count / WORKGROUP_SIZE + 1u; iteration++) {
        let k = iteration * WORKGROUP_SIZE + local_index;
        if (k < count) {
            atomicStore(&receptors[k].bound, 0u);
            atomicStore(&receptors[k].requests, 0u);
        }
    }
}
