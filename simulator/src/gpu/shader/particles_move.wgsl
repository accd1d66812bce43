// The step of every particle by itself where no surface turns it back: it moves, meets walls and receivers, and may decay.
// What is removed stays in its place with a negative radius, which pairs with nothing, until the end of the step.
#include control
#include params
#include philox
#include normal
#include boundary
#include fate

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> journey: Journey;
@group(0) @binding(2) var<storage, read_write> control: Control;
@group(0) @binding(3) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> moved: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> species: array<u32>;
@group(0) @binding(7) var<storage, read> kinds: array<Kind>;
@group(0) @binding(8) var<storage, read> fates: array<Fate>;
@group(0) @binding(9) var<storage, read> bodies: array<vec4<u32>>;

#include seen
#include meeting
#include decaying

@compute @workgroup_size(256)
fn particles_move(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) lane: u32) {
    let at = place_of(group, groups, lane);
    if (at >= control.count) {
        return;
    }
    let before = spheres[at];
    let tag = tags[at];
    let kind = kinds[tag.x];
    let path = path_of(before.xyz, kind, tag.y);
    var here = Moved(vec4(path.after, before.w), tag.x);
    var arrives = false;
    let seen = seen_by(kind, before.xyz, reach_of(path) + kind.bend + journey.longest);
    for (var k = seen.begin; k < seen.end; k++) {
        let fate = fates[fate_at(seen, k)];
        if (meets(fate, body_in(fate.receiver, control.step), path, kind.diffusion, tag.y)) {
            atomicAdd(&control.tallies[fate.tally], 1u);
            here.sphere.w = -1.0;
            arrives = true;
            break;
        }
    }
    if (!arrives) {
        here = decayed(here.sphere, tag.x, tag.y);
    }
    if (here.sphere.w < 0.0) {
        atomicAdd(&control.gone, 1u);
    }
    moved[at] = here.sphere;
    species[at] = here.species;
}
