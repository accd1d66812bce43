// Decides between equal priorities by the ids.
#include control
#include candidate
#include round

@group(0) @binding(0) var<uniform> round: Round;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read> candidates: array<Candidate>;
@group(0) @binding(3) var<storage, read> rules: array<Rule>;
@group(0) @binding(4) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(5) var<storage, read> left_next: array<u32>;

#include claiming

@compute @workgroup_size(256)
fn matching_tie(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) lane: u32) {
    let count = atomicLoad(&control.left[1u - round.source]);
    let threads = groups.x * GROUP;
    let turns = count / threads + 1u;
    for (var turn = 0u; turn < turns; turn++) {
        let k = group.x * GROUP + lane + turn * threads;
        if (k >= count) {
            break;
        }
        break_tie(left_next[k]);
    }
}
