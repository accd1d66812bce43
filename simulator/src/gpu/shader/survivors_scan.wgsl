// Where each workgroup's survivors begin, behind how many particles the step had. With that the step is settled: it enters the counts.
#include control
#include params
#include running_sum

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read_write> sums: array<u32>;
@group(0) @binding(3) var<storage, read_write> log: array<vec2<u32>>;

var<workgroup> group_frozen: u32;

// Whether the run stands still; the same for the whole workgroup, which takes part in sums as a whole or not at all.
fn stands_still(lane: u32) -> bool {
    if (lane == 0u) {
        group_frozen = control.frozen;
    }
    return workgroupUniformLoad(&group_frozen) != 0u;
}

@compute @workgroup_size(256)
fn survivors_scan(@builtin(local_invocation_index) lane: u32) {
    if (stands_still(lane)) {
        if (lane == 0u) {
            sums[0] = 0u;
        }
        return;
    }
    if (lane == 0u) {
        sums[0] = control.count;
    }
    let count = (control.count + GROUP - 1u) / GROUP;
    let share = (count + GROUP - 1u) / GROUP;
    let begin = min(lane * share, count);
    let end = min(begin + share, count);
    var own = 0u;
    for (var k = begin; k < end; k++) {
        own += sums[1u + k];
    }
    let through = running_sum(own, lane);
    var before = through - own;
    for (var k = begin; k < end; k++) {
        let here = sums[1u + k];
        sums[1u + k] = before;
        before += here;
    }
    for (var turn = 0u; turn < params.tallies / GROUP + 1u; turn++) {
        let k = turn * GROUP + lane;
        if (k < params.tallies) {
            atomicAdd(&control.tallies[params.tallies + k], atomicLoad(&control.tallies[k]));
        }
    }
    if (lane == GROUP - 1u) {
        control.alive = through;
        control.done = control.step + 1u;
        log[control.logged] = vec2(control.found_lo, control.found_hi);
        control.logged += 1u;
    }
}
