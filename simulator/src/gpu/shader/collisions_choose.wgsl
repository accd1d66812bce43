// Chooses safe events that are the next of both particles; see collisions/rounds.rs.
#include control
#include params
#include boundary
#include gap
#include window
#include round

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> round: Round;
@group(0) @binding(2) var<storage, read_write> control: Control;
@group(0) @binding(3) var<storage, read_write> window: Window;
@group(0) @binding(4) var<storage, read> movers: array<Mover>;
@group(0) @binding(5) var<storage, read_write> next_events: array<NextEvent>;
@group(0) @binding(6) var<storage, read> neighbors: array<u32>;

const MAX_ITERATIONS: u32 = 60000u;

var<private> iterations: u32;

// Bounds the time at which `left`, off its path at or after `time`, hits `steady`.
fn hit(left: Mover, steady: Mover, time: f32) -> f32 {
    let gap = gap_at(left, steady, max(time, max(left.time, steady.time))) + SLACK * (left.radius + steady.radius);
    return time + max(gap, 0.0) / (window.top_speed + length(steady.motion));
}

// Bounds the time at which a particle leaves its path, unless one of the pair hits it.
fn leaves(other: u32, pair: vec2<u32>, earliest: f32) -> f32 {
    let mover = movers[other];
    let next = next_events[other];
    var first = next.time;
    for (var k = next.begin; k < next.begin + next.count; k++) {
        let third = neighbors[k];
        if ((third & PASSES) == 0u && third != pair.x && third != pair.y) {
            first = min(first, hit(movers[third], mover, earliest));
        }
        iterations += 1u;
    }
    return first;
}

fn is_safe(at: u32, pair: vec2<u32>, time: f32, earliest: f32) -> bool {
    let mover = movers[at];
    let begin = next_events[at].begin;
    let end = begin + next_events[at].count;
    for (var k = begin; k < end; k++) {
        if (iterations >= MAX_ITERATIONS) {
            return false;
        }
        let other = neighbors[k];
        iterations += 1u;
        if ((other & PASSES) != 0u || other == pair.x || other == pair.y || hit(movers[other], mover, earliest) >= time) {
            continue;
        }
        if (hit(movers[other], mover, min(leaves(other, pair, earliest), time)) < time) {
            return false;
        }
    }
    return true;
}

fn happens(at: u32, earliest: f32) -> bool {
    let next = next_events[at];
    let partner = next.partner & ~PASSES;
    if (next.time > window.horizon) {
        return false;
    }
    if (partner >= WALLS) {
        return is_safe(at, vec2(at), next.time, earliest);
    }
    if (next_events[partner].partner != (at | (next.partner & PASSES))) {
        return false;
    }
    if ((next.partner & PASSES) != 0u) {
        return true;
    }
    // In the same order for both: compilers may round two copies of the test differently.
    let pair = vec2(min(at, partner), max(at, partner));
    return is_safe(pair.x, pair, next.time, earliest) && is_safe(pair.y, pair, next.time, earliest);
}

@compute @workgroup_size(256)
fn collisions_choose(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                     @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    if (at == 0u) {
        atomicStore(&window.earliest[1u - round.source], LATER);
    }
    if (at >= window.count || is_over(round.source)) {
        return;
    }
    iterations = 0u;
    let earliest = bitcast<f32>(atomicLoad(&window.earliest[round.source]));
    next_events[at].happens = select(0u, 1u, happens(at, earliest));
    if (iterations >= MAX_ITERATIONS) {
        atomicOr(&control.halted, TOO_MANY_NEIGHBORS);
    }
}
