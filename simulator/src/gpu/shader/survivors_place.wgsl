// Brings the particles that stay together, in the order of the detector's cells, as what has become of them.
#include control
#include candidate
#include running_sum

@group(0) @binding(0) var<uniform> listing: Listing;
@group(0) @binding(1) var<storage, read> order: array<u32>;
@group(0) @binding(2) var<storage, read> moved: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> species: array<u32>;
@group(0) @binding(4) var<storage, read> ids: array<u32>;
@group(0) @binding(5) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(6) var<storage, read> sums: array<u32>;
@group(0) @binding(7) var<storage, read_write> spheres: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read_write> tags: array<vec2<u32>>;

#include listing
#include survivor

@compute @workgroup_size(256)
fn survivors_place(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) lane: u32) {
    let k = place_of(group, groups, lane);
    // None where the run stands still.
    let count = sums[0];
    let at = listed(k, count);
    let stays = survives(at, count);
    let rank = running_sum(select(0u, 1u, stays), lane);
    if (k >= count) {
        return;
    }
    if (stays) {
        let to = sums[1u + k / GROUP] + rank - 1u;
        if (atomicLoad(&claims[at].is_taken) == 0u) {
            spheres[to] = moved[at];
            tags[to] = vec2(species[at], ids[k]);
        } else {
            spheres[to] = claims[at].sphere;
            tags[to] = vec2(claims[at].product, ids[k]);
        }
    }
    // Clean for the next step.
    atomicStore(&claims[at].is_taken, 0u);
}
