#include control
#include receptor
#include running_sum

@group(0) @binding(0) var<storage, read_write> control: Control;
@group(0) @binding(1) var<storage, read_write> receptors: array<Receptors>;

const MAX_REQUESTS: u32 = 1u << 20u;

@compute @workgroup_size(256)
fn receptors_scan_requests(@builtin(local_invocation_index) local_index: u32) {
    let count = arrayLength(&receptors);
    let chunk = (count + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
    let begin = min(local_index * chunk, count);
    let end = min(begin + chunk, count);
    var own = 0u;
    for (var k = begin; k < end; k++) {
        let requests = atomicLoad(&receptors[k].requests);
        own += requests;
        if (requests > MAX_REQUESTS) {
            atomicMax(&control.requests, requests);
            atomicOr(&control.halted, TOO_MANY_REQUESTS);
        }
    }
    var before = running_sum(own, local_index) - own;
    for (var k = begin; k < end; k++) {
        receptors[k].first = before;
        before += atomicLoad(&receptors[k].requests);
    }
}
