#include control
#include params
#include candidate
#include running_sum

@group(0) @binding(0) var<uniform> output_order: OutputOrder;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> moved: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(6) var<storage, read_write> ids: array<u32>;
@group(0) @binding(7) var<storage, read_write> sums: array<u32>;
@group(0) @binding(8) var<uniform> params: Params;
// See simulation/events.rs.
@group(0) @binding(9) var<storage, read_write> events: array<vec4<u32>>;

#include output_order
#include compaction

fn log_arrival(at: u32) {
    let radius = moved[at].w;
    if (radius >= -1.0 || radius <= -2.0 || atomicLoad(&control.halted) != 0u) {
        return;
    }
    let arrival = u32((-1.0 - radius) * 0x1p23 + 0.5) - 1u;
    let slot = atomicAdd(&control.events, 1u);
    if (slot < arrayLength(&events)) {
        events[slot] = vec4(control.step, arrival / params.species, arrival % params.species, tags[at].y);
    }
}

@compute @workgroup_size(256)
fn survivors_count(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local_index: u32) {
    let k = global_index(group, groups, local_index);
    let count = control.count;
    let at = output_index(k, count);
    let sum = running_sum(select(0u, 1u, survives(at, count)), local_index);
    if (at < count) {
        // survivors_place overwrites tags, so ids are copied.
        ids[k] = tags[at].y;
        if (params.logs_arrivals != 0u) {
            log_arrival(at);
        }
    }
    if (local_index == WORKGROUP_SIZE - 1u && k - local_index < count) {
        sums[1u + k / WORKGROUP_SIZE] = sum;
    }
}
