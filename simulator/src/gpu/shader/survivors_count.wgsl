// Counts the particles that stay, by workgroup.
#include control
#include candidate
#include running_sum

@group(0) @binding(0) var<storage, read_write> control: Control;
@group(0) @binding(1) var<storage, read> moved: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(3) var<storage, read_write> sums: array<u32>;

#include survivor

@compute @workgroup_size(256)
fn survivors_count(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) lane: u32) {
    let at = place_of(group, groups, lane);
    let sum = running_sum(select(0u, 1u, survives(at)), lane);
    if (lane == GROUP - 1u && at - lane < control.count) {
        sums[at / GROUP] = sum;
    }
}
