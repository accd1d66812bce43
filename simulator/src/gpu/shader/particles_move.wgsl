// The step of every particle by itself: it moves, meets walls and receivers, and may decay. What is removed stays in
// its place with a negative radius, which pairs with nothing, until the end of the step.
#include control
#include params
#include philox
#include normal
#include boundary

struct Kind {
    drift: vec3<f32>,
    // Standard deviation along each axis.
    length: f32,
    // D dt.
    diffusion: f32,
    radius: f32,
    // Its part of the table of fates.
    fates_begin: u32,
    fates_end: u32,
}

// What may befall a particle of one species, in the order of their precedence.
struct Fate {
    center: vec3<f32>,
    radius: f32,
    kind: u32,
    // The receiver's place in the model.
    receiver: u32,
    // The largest word at which it decays.
    up_to: u32,
    product: u32,
    tally: u32,
}

const ABSORBING: u32 = 0u;
const ENDPOINT: u32 = 1u;
const NOTHING: u32 = 0xffffffffu;
// Beyond this exponent the probability is below the smallest random number.
const NEVER: f32 = 17.0;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> control: Control;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> tags: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> moved: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> species: array<u32>;
@group(0) @binding(6) var<storage, read_write> ids: array<u32>;
@group(0) @binding(7) var<storage, read> kinds: array<Kind>;
@group(0) @binding(8) var<storage, read> fates: array<Fate>;

fn height(fate: Fate, point: vec3<f32>) -> f32 {
    let d = nearest(point - fate.center);
    return sqrt(d.x * d.x + d.y * d.y + d.z * d.z) - fate.radius;
}

// Whether a particle that drifted from `before` to `after` came through the sphere on its way.
fn passes(fate: Fate, before: vec3<f32>, after: vec3<f32>) -> bool {
    let center = fate.center;
    let start = nearest(before - center);
    let way = nearest(after - before);
    let across = cross(start, way);
    return dot(start, way) < 0.0 && dot(start + way, way) > 0.0
        && dot(across, across) <= fate.radius * fate.radius * dot(way, way);
}

// Whether a particle that went from `before` to `after` met the receiver.
fn meets(fate: Fate, before: vec3<f32>, after: vec3<f32>, diffusion: f32, id: u32) -> bool {
    let b = height(fate, after);
    if (b <= 0.0) {
        return true;
    }
    if (fate.kind == ENDPOINT) {
        return false;
    }
    let a = height(fate, before);
    if (diffusion == 0.0) {
        // At rest, or carried out or through by a drift.
        return a < 0.0 || passes(fate, before, after);
    }
    let exponent = a * b / diffusion;
    if (exponent >= NEVER) {
        return false;
    }
    let word = philox(vec4(id, fate.receiver, control.step, PURPOSE_RECEIVER), params.key).x;
    return open_unit(word) < exp(-exponent);
}

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
    let step = control.step;
    let random = normals(philox(vec4(tag.y, 0u, step, PURPOSE_MOVE), params.key));
    var after = placed(before.xyz + (kind.length * random + kind.drift), kind.radius);
    var radius = before.w;
    var becomes = tag.x;
    for (var k = kind.fates_begin; k < kind.fates_end; k++) {
        let fate = fates[k];
        var happens = false;
        if (fate.kind <= ENDPOINT) {
            happens = meets(fate, before.xyz, after, kind.diffusion, tag.y);
        } else {
            happens = philox(vec4(tag.y, 0u, step, PURPOSE_DECAY), params.key).x <= fate.up_to;
        }
        if (happens) {
            atomicAdd(&control.tallies[fate.tally], 1u);
            if (fate.product == NOTHING) {
                radius = -1.0;
                atomicAdd(&control.gone, 1u);
            } else {
                becomes = fate.product;
                radius = kinds[becomes].radius;
                // What is larger than it was may stand in a wall.
                after = placed(after, radius);
            }
            break;
        }
    }
    moved[at] = vec4(after, radius);
    species[at] = becomes;
    ids[at] = tag.y;
}
