// Lists the particles that are to bind, by receiver.
#include control
#include candidate
#include fate_rows
#include receptor

@group(0) @binding(0) var<storage, read_write> control: Control;
@group(0) @binding(1) var<storage, read> fates: array<Fate>;
@group(0) @binding(2) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(3) var<storage, read_write> receptors: array<Receptors>;
@group(0) @binding(4) var<storage, read_write> bidders: array<u32>;

@compute @workgroup_size(256)
fn receptors_group(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) lane: u32) {
    let at = place_of(group, groups, lane);
    if (at >= control.count || atomicLoad(&claims[at].is_taken) == 0u) {
        return;
    }
    let first = receptors[fates[claims[at].product].receiver].first;
    bidders[first + atomicLoad(&claims[at].other)] = at;
    // For the matching it is as free as others.
    atomicStore(&claims[at].is_taken, 0u);
}
