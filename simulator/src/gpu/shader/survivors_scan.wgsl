// Computes the first output index of each workgroup, after the number of particles of the step. Then commits the step to
// the counts.
#include control
#include params
#include running_sum

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read_write> sums: array<u32>;
@group(0) @binding(3) var<storage, read_write> log: array<vec2<u32>>;

var<workgroup> group_halted: u32;

// Returns true if the run is halted. The result is uniform, because sums need the whole workgroup.
fn is_halted(local_index: u32) -> bool {
    if (local_index == 0u) {
        group_halted = control.halted;
    }
    return workgroupUniformLoad(&group_halted) != 0u;
}

@compute @workgroup_size(256)
fn survivors_scan(@builtin(local_invocation_index) local_index: u32) {
    if (is_halted(local_index)) {
        if (local_index == 0u) {
            sums[0] = 0u;
        }
        return;
    }
    if (local_index == 0u) {
        sums[0] = control.count;
    }
    let count = (control.count + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
    let chunk = (count + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
    let begin = min(local_index * chunk, count);
    let end = min(begin + chunk, count);
    var own = 0u;
    for (var k = begin; k < end; k++) {
        own += sums[1u + k];
    }
    let through = running_sum(own, local_index);
    var before = through - own;
    for (var k = begin; k < end; k++) {
        let here = sums[1u + k];
        sums[1u + k] = before;
        before += here;
    }
    for (var iteration = 0u; iteration < params.tallies / WORKGROUP_SIZE + 1u; iteration++) {
        let k = iteration * WORKGROUP_SIZE + local_index;
        if (k < params.tallies) {
            atomicAdd(&control.tallies[params.tallies + k], atomicLoad(&control.tallies[k]));
        }
    }
    if (local_index == WORKGROUP_SIZE - 1u) {
        control.alive = through;
        control.done = control.step + 1u;
        log[control.logged] = vec2(control.found_lo, control.found_hi);
        control.logged += 1u;
    }
}
