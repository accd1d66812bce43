// Events of a round share no particle. See collisions/rules.rs.
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
@group(0) @binding(4) var<storage, read_write> movers: array<Mover>;
@group(0) @binding(5) var<storage, read_write> next_events: array<NextEvent>;

fn advanced(at: u32, time: f32) -> Mover {
    var mover = movers[at];
    mover.offset = offset_at(mover, time);
    mover.time = time;
    return mover;
}

fn reflect_at_wall(mover: Mover, wall: u32) -> Mover {
    var reflected = mover;
    if (wall == VESSEL_WALL) {
        let out = across_vessel(mover.base + mover.offset);
        let normal = out / max(length(out), 1e-37);
        reflected.motion -= 2.0 * dot(mover.motion, normal) * normal;
        reflected.own -= 2.0 * dot(mover.own, normal) * normal;
        return reflected;
    }
    let axis = (wall - WALLS) / 2u;
    reflected.motion = with_component(mover.motion, axis, -mover.motion[axis]);
    reflected.own = with_component(mover.own, axis, -mover.own[axis]);
    return reflected;
}

fn collide(at: u32, partner: u32, time: f32) -> bool {
    var a = advanced(at, time);
    var b = advanced(partner, time);
    let d = displacement_at(a, b, time);
    let shares = select(vec2(a.mobility, b.mobility), vec2(1.0), a.mobility + b.mobility == 0.0);
    let unit = 2.0 / (dot(d, d) * (shares.x + shares.y));
    let approach = -dot(d, b.motion - a.motion);
    if (approach > 0.0) {
        a.motion -= (unit * approach * shares.x) * d;
        b.motion += (unit * approach * shares.y) * d;
    }
    let own_approach = -dot(d, b.own - a.own);
    if (params.is_elastic != 0u && own_approach > 0.0) {
        a.own -= (unit * own_approach * shares.x) * d;
        b.own += (unit * own_approach * shares.y) * d;
    }
    movers[at] = a;
    movers[partner] = b;
    if (max(length(a.motion), length(b.motion)) > window.top_speed) {
        atomicOr(&control.halted, TOO_FAST);
    }
    return approach > 0.0;
}

@compute @workgroup_size(256)
fn collisions_apply(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local_index: u32) {
    let at = global_index(group, groups, local_index);
    if (at >= window.count || is_over(round.source) || next_events[at].happens == 0u) {
        return;
    }
    let time = next_events[at].time;
    let partner = next_events[at].partner & ~PASSES;
    if (partner >= WALLS) {
        movers[at] = reflect_at_wall(advanced(at, time), partner);
        return;
    }
    if (at > partner) {
        return;
    }
    if ((next_events[at].partner & PASSES) != 0u) {
        next_events[at].bounces_from = movers[partner].id + 1u;
        next_events[partner].bounces_from = movers[at].id + 1u;
    }
    if (collide(at, partner, time)) {
        next_events[at].collided = 1u;
        next_events[partner].collided = 1u;
        atomicAdd(&control.contacts, 1u);
    }
}
