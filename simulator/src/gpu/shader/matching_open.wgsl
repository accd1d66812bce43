// Begins a round of the matching: lists the candidates that are left and clears what the round before entered at
// their particles.
#include control
#include candidate
#include round

@group(0) @binding(0) var<uniform> round: Round;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read> candidates: array<Candidate>;
@group(0) @binding(3) var<storage, read> rules: array<Rule>;
@group(0) @binding(4) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(5) var<storage, read> left: array<u32>;
@group(0) @binding(6) var<storage, read_write> left_next: array<u32>;

#include claiming

@compute @workgroup_size(256)
fn matching_open(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) lane: u32) {
    let count = atomicLoad(&control.left[round.source]);
    let threads = groups.x * GROUP;
    let turns = count / threads + 1u;
    for (var turn = 0u; turn < turns; turn++) {
        let k = group.x * GROUP + lane + turn * threads;
        if (k >= count) {
            break;
        }
        let index = left[k];
        if (is_free(candidates[index], rules[candidates[index].rule])) {
            left_next[atomicAdd(&control.left[1u - round.source], 1u)] = index;
            clear(index);
        }
    }
}
