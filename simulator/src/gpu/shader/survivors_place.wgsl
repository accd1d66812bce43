#include control
#include params
#include candidate
#include running_sum

@group(0) @binding(0) var<uniform> output_order: OutputOrder;
@group(0) @binding(1) var<storage, read> order: array<u32>;
@group(0) @binding(2) var<storage, read> moved: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> species: array<u32>;
@group(0) @binding(4) var<storage, read> ids: array<u32>;
@group(0) @binding(5) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(6) var<storage, read> sums: array<u32>;
@group(0) @binding(7) var<storage, read_write> spheres: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read_write> tags: array<vec2<u32>>;
@group(0) @binding(9) var<uniform> params: Params;

#include velocity_index
#include output_order
#include compaction

@compute @workgroup_size(256)
fn survivors_place(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local_index: u32) {
    let k = global_index(group, groups, local_index);
    let count = sums[0];
    let at = output_index(k, count);
    let adsorbs = survives(at, count);
    let rank = running_sum(select(0u, 1u, adsorbs), local_index);
    if (k >= count) {
        return;
    }
    if (adsorbs) {
        let to = sums[1u + k / WORKGROUP_SIZE] + rank - 1u;
        if (params.has_velocity != 0u) {
            spheres[velocity_at(to)] = moved[velocity_at(at)];
        }
        if (atomicLoad(&claims[at].is_taken) == 0u) {
            spheres[to] = moved[at];
            tags[to] = vec2(species[at], ids[k]);
        } else {
            spheres[to] = claims[at].sphere;
            tags[to] = vec2(claims[at].product, ids[k]);
        }
    }
    atomicStore(&claims[at].is_taken, 0u);
}
