// Counts the particles that stay, by workgroup, in the order in which they are to stand.
#include control
#include candidate
#include running_sum

@group(0) @binding(0) var<uniform> listing: Listing;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> moved: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(6) var<storage, read_write> ids: array<u32>;
@group(0) @binding(7) var<storage, read_write> sums: array<u32>;

#include listing
#include survivor

@compute @workgroup_size(256)
fn survivors_count(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) lane: u32) {
    let k = place_of(group, groups, lane);
    let count = control.count;
    let at = listed(k, count);
    let sum = running_sum(select(0u, 1u, survives(at, count)), lane);
    if (at < count) {
        // Tags are written where they are read when particles are brought together.
        ids[k] = tags[at].y;
    }
    if (lane == GROUP - 1u && k - lane < count) {
        sums[1u + k / GROUP] = sum;
    }
}
