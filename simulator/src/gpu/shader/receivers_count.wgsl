// How many particles of each species are inside the transparent receivers. Runs when the host looks.
#include control
#include params
#include boundary
#include fate

struct Watch {
    // The receiver's place in the model.
    receiver: u32,
    radius: f32,
    // Where the counts of its receiver begin.
    first: u32,
    species: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> journey: Journey;
@group(0) @binding(2) var<storage, read_write> control: Control;
@group(0) @binding(3) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> watches: array<Watch>;
@group(0) @binding(6) var<storage, read> bodies: array<vec4<u32>>;
@group(0) @binding(7) var<storage, read_write> inside: array<atomic<u32>>;

@compute @workgroup_size(256)
fn receivers_count(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) lane: u32) {
    let at = place_of(group, groups, lane);
    // Nobody is inside who is held somewhere.
    if (at >= control.alive || spheres[at].w < 0.0) {
        return;
    }
    for (var k = 0u; k < arrayLength(&watches); k++) {
        let watch = watches[k];
        let center = body_in(watch.receiver, control.done).center;
        if (tags[at].x == watch.species && height(watch.radius, center, spheres[at].xyz) <= 0.0) {
            atomicAdd(&inside[watch.first], 1u);
        }
    }
}
