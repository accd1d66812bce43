// Runs before each readback.
#include control
#include params
#include boundary
#include event
#include tag

struct OccupancyRow {
    receiver: u32,
    radius: f32,
    first: u32,
    species: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> trajectory: TrajectoryHeader;
@group(0) @binding(2) var<storage, read_write> control: Control;
@group(0) @binding(3) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> occupancy_rows: array<OccupancyRow>;
@group(0) @binding(6) var<storage, read> scene_rows: array<vec4<u32>>;
@group(0) @binding(7) var<storage, read_write> inside: array<atomic<u32>>;

@compute @workgroup_size(256)
fn receivers_count(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    if (at >= control.alive || spheres[at].w < 0.0) {
        return;
    }
    let species = species_of(tags[at]);
    for (var k = 0u; k < arrayLength(&occupancy_rows); k++) {
        let row = occupancy_rows[k];
        if (row.species != species) {
            continue;
        }
        let center = receiver_at(row.receiver, control.done).center;
        if (signed_distance(row.radius, center, spheres[at].xyz) <= 0.0) {
            atomicAdd(&inside[row.first], 1u);
        }
    }
}
