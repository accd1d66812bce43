#include control
#include candidate
#include event_rows
#include receptor

@group(0) @binding(0) var<storage, read_write> control: Control;
@group(0) @binding(1) var<storage, read> event_rows: array<EventRow>;
@group(0) @binding(2) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(3) var<storage, read_write> receptors: array<Receptors>;
@group(0) @binding(4) var<storage, read_write> requesters: array<u32>;

@compute @workgroup_size(256)
fn receptors_group_requests(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    if (at >= control.count || atomicLoad(&claims[at].is_taken) == 0u) {
        return;
    }
    let first = receptors[event_rows[claims[at].product].receptor].first;
    requesters[first + atomicLoad(&claims[at].other)] = at;
    // The matching must treat the particle as free.
    atomicStore(&claims[at].is_taken, 0u);
}
