// The argument is the function of one candidate.
#include control
#include candidate
#include round

@group(0) @binding(0) var<uniform> round: Round;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read> candidates: array<Candidate>;
@group(0) @binding(3) var<storage, read> reaction_rows: array<ReactionRow>;
@group(0) @binding(4) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(5) var<storage, read> left_next: array<u32>;

#include claims

@compute @workgroup_size(256)
fn matching_#{ARGUMENT}(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local_index: u32) {
    let count = atomicLoad(&control.left[1u - round.source]);
    let threads = groups.x * WORKGROUP_SIZE;
    let iterations = count / threads + 1u;
    for (var iteration = 0u; iteration < iterations; iteration++) {
        let k = group.x * WORKGROUP_SIZE + local_index + iteration * threads;
        if (k >= count) {
            break;
        }
        #{ARGUMENT}(left_next[k]);
    }
}
