// The step of every particle by itself where surfaces turn some back: as particles_move, and some stay on a surface, for
// good or until they come off again. Those that are to bind to receptors are decided about behind this.
#include control
#include params
#include philox
#include normal
#include boundary
#include candidate
#include fate
#include receptor

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
@group(0) @binding(10) var<storage, read_write> claims: array<Claim>;
@group(0) @binding(11) var<storage, read_write> receptors: array<Receptors>;

#include seen
#include meeting
#include decaying
#include turning
#include adsorption

const BIDS: u32 = 2u;

fn free_of(receiver: u32) -> u32 {
    let count = receptors[receiver].count;
    return count - min(count, atomicLoad(&receptors[receiver].held));
}

// Whether a particle that reached a surface stays there; `word` is its draw.
fn stays(fate: Fate, distances: f32, word: u32) -> bool {
    if (fate.kind == PER_STEP) {
        return word <= fate.up_to;
    }
    var own = fate.own;
    if (fate.kind == RECEPTORS) {
        own *= f32(free_of(fate.receiver));
    }
    return fine_unit(word) < sticking(surface_of(own, fate.length, fate.radius), distances);
}

// Enters that a particle is to bind, with its direction from the centre where it touched the surface.
fn bid(at: u32, k: u32, touching: vec3<f32>, center: vec3<f32>, rank: u32) {
    let out = nearest(touching - center);
    let distance = length(out);
    let direction = select(vec3(1.0, 0.0, 0.0), out / max(distance, 1e-37), distance > 0.0);
    claims[at].sphere = vec4(direction, 0.0);
    claims[at].product = k;
    atomicStore(&claims[at].priority, rank);
    atomicStore(&claims[at].other, atomicAdd(&receptors[fates[k].receiver].bids, 1u));
    atomicStore(&claims[at].is_taken, BIDS);
}

// A held particle in a step: it stays so, or comes off and stands at some height above where it was.
fn released(held: vec4<f32>, id: u32, kind: Kind) -> vec4<f32> {
    let fate = fates[fate_of_held(held)];
    // As many bind to those that are free then as come off to leave them so.
    let own = fate.own * (f32(free_of(fate.receiver)) + 1.0);
    let surface = surface_of(own, fate.length, fate.radius);
    var draws = Draws(vec4(id, 0u, control.step, PURPOSE_UNBINDING), vec4(0u), 4u);
    if (unit_of(&draws) >= fate.unbinding * effective_part(surface)) {
        return held;
    }
    let center = body_in(fate.receiver, control.step + 1u).center;
    let above = fate.radius + height_after(surface, &draws);
    let away = above + 4e-6 * (abs(center.x) + abs(center.y) + abs(center.z) + above);
    let place = placed(center + away * held.xyz, kind.radius);
    if (height(fate.radius, center, place) < 0.0) {
        // Walls leave it no room.
        return held;
    }
    atomicSub(&control.tallies[fate.tally], 1u);
    return vec4(place, kind.radius);
}

// What becomes of a particle that moves freely.
fn settled(at: u32, path: Path, kind: Kind, tag: vec2<u32>, radius: f32) -> Moved {
    let turned = turned_back(kind, path);
    if (near_count > NEAR) {
        control.lacking_lo = near_count;
        control.lacking_hi = 0u;
        control.frozen = TOO_MANY_NEAR;
    } else if (thrown_too_far) {
        control.lacking_lo = params.looks + 1u;
        control.lacking_hi = 0u;
        control.frozen = THROWN_TOO_FAR;
    }
    var here = Moved(vec4(turned.after, radius), tag.x);
    let reach = max(reach_of(path), max(turned.gone, length(nearest(turned.after - path.before))));
    let seen = seen_by(kind, path.before, reach + kind.bend + journey.longest);
    for (var k = seen.begin; k < seen.end; k++) {
        let place = fate_at(seen, k);
        let fate = fates[place];
        let body = body_in(fate.receiver, control.step);
        // What is inside may leave.
        let leaves = fate.kind > REFLECTING && height(fate.radius, body.center, path.before) < 0.0;
        if (fate.kind == REFLECTING || leaves) {
            continue;
        }
        var way = path;
        if (turned.first != fate.receiver) {
            // Where another surface turned the way first.
            way.end = turned.end;
            way.after = turned.after;
        }
        if (!meets(fate, body, way, kind.diffusion, tag.y)) {
            continue;
        }
        if (fate.kind > REFLECTING) {
            let a = abs(height(fate.radius, body.center, way.before));
            let b = abs(height(fate.radius, body.center + body.way, way.after));
            let words = philox(vec4(tag.y, fate.receiver, control.step, PURPOSE_RECEIVER), params.key);
            if (!stays(fate, a + b, words.y)) {
                continue;
            }
            if (fate.kind == RECEPTORS) {
                var time = 0.0;
                if (a + b > 0.0) {
                    time = a / (a + b);
                }
                let touching = way.before + time * (way.end - way.before);
                bid(at, place, touching, body.center + time * body.way, words.z);
                return here;
            }
        }
        atomicAdd(&control.tallies[fate.tally], 1u);
        here.sphere.w = -1.0;
        return here;
    }
    return decayed(here.sphere, tag.x, tag.y);
}

@compute @workgroup_size(256)
fn particles_turn(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) lane: u32) {
    let at = place_of(group, groups, lane);
    if (at >= control.count) {
        return;
    }
    let before = spheres[at];
    let tag = tags[at];
    let kind = kinds[tag.x];
    var here = Moved(before, tag.x);
    if (before.w <= HELD) {
        here.sphere = released(before, tag.y, kind);
    } else {
        here = settled(at, path_of(before.xyz, kind, tag.y), kind, tag, before.w);
    }
    if (here.sphere.w < 0.0) {
        atomicAdd(&control.gone, 1u);
    }
    moved[at] = here.sphere;
    species[at] = here.species;
}
