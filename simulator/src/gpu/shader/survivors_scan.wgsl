// Computes each workgroup's first output index, then commits the step.
#include control
#include params
#include running_sum

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read_write> sums: array<u32>;
@group(0) @binding(3) var<storage, read_write> log: array<vec2<u32>>;

const MAX_ID: u32 = 0xfffffffeu;
// Sums of a thread, so that the workgroup reads whole lines.
const ITEMS: u32 = 16u;

var<workgroup> group_halted: u32;
var<workgroup> group_total: u32;

// Halts the run if a result of the step does not fit.
fn has_capacity(survivors: u32) -> bool {
    let born = atomicLoad(&control.born);
    let logged = select(0u, born, params.logs_arrivals != 0u);
    let events = atomicLoad(&control.events) + logged;
    var reason = 0u;
    if (born > control.max_births) {
        reason = BIRTH_OVERFLOW;
        control.missing_lo = born;
    } else if (born > control.capacity - survivors) {
        reason = PARTICLE_OVERFLOW;
        control.missing_lo = survivors + born;
    } else if (born > MAX_ID - control.next_id) {
        reason = OUT_OF_IDS;
        control.missing_lo = born;
    } else if (events > control.max_events) {
        reason = EVENT_OVERFLOW;
        control.missing_lo = events - control.committed_events;
    }
    control.missing_hi = 0u;
    atomicOr(&control.halted, reason);
    return reason == 0u;
}

fn commit(survivors: u32) {
    let born = atomicLoad(&control.born);
    control.born_at = survivors;
    control.born_id = control.next_id;
    control.born_event = atomicLoad(&control.events);
    control.next_id += born;
    control.committed_events = control.born_event + select(0u, born, params.logs_arrivals != 0u);
    control.alive = survivors + born;
    control.done = control.step + 1u;
    control.committed_contacts = atomicLoad(&control.contacts);
    log[control.logged] = vec2(control.found_lo, control.found_hi);
    control.logged += 1u;
}

// Uniform, since sums need the whole workgroup.
fn is_halted(local_index: u32) -> bool {
    if (local_index == 0u) {
        group_halted = atomicLoad(&control.halted);
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
        group_total = (control.count + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
    }
    let count = workgroupUniformLoad(&group_total);
    let rounds = (count + WORKGROUP_SIZE * ITEMS - 1u) / (WORKGROUP_SIZE * ITEMS);
    var survivors = 0u;
    for (var round = 0u; round < rounds; round++) {
        let first = (round * WORKGROUP_SIZE + local_index) * ITEMS;
        var own = 0u;
        for (var item = 0u; item < ITEMS; item++) {
            if (first + item < count) {
                own += sums[1u + first + item];
            }
        }
        let through = survivors + running_sum(own, local_index);
        var before = through - own;
        for (var item = 0u; item < ITEMS; item++) {
            if (first + item < count) {
                let here = sums[1u + first + item];
                sums[1u + first + item] = before;
                before += here;
            }
        }
        if (local_index == WORKGROUP_SIZE - 1u) {
            group_total = through;
        }
        survivors = workgroupUniformLoad(&group_total);
    }
    if (local_index == 0u) {
        sums[0] = select(0u, control.count, has_capacity(survivors));
    }
    if (is_halted(local_index)) {
        return;
    }
    for (var iteration = 0u; iteration < params.tallies / WORKGROUP_SIZE + 1u; iteration++) {
        let k = iteration * WORKGROUP_SIZE + local_index;
        if (k < params.tallies) {
            atomicAdd(&control.tallies[params.tallies + k], atomicLoad(&control.tallies[k]));
        }
    }
    if (local_index == 0u) {
        commit(survivors);
    }
}
