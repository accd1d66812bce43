// Predicts events of particles that changed, or whose neighbors did.
#include control
#include params
#include boundary
#include gap
#include window
#include round

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> round: Round;
@group(0) @binding(2) var<storage, read_write> window: Window;
@group(0) @binding(3) var<storage, read> movers: array<Mover>;
@group(0) @binding(4) var<storage, read_write> next_events: array<NextEvent>;
@group(0) @binding(5) var<storage, read> neighbors: array<u32>;

#include events

var<workgroup> earliest: atomic<u32>;

fn is_before(time: f32, partner: u32, now: NextEvent) -> bool {
    if (time != now.time) {
        return time < now.time;
    }
    if (partner >= WALLS || now.partner >= WALLS) {
        return partner < now.partner;
    }
    return movers[partner].id < movers[now.partner].id;
}

fn predict(at: u32) -> f32 {
    var next = next_events[at];
    let mover = movers[at];
    var is_stale = next.happens != 0u;
    if (!is_stale && next.partner < WALLS) {
        is_stale = next_events[next.partner].happens != 0u;
    }
    if (is_stale) {
        let hit = wall_hit(mover);
        next.time = hit.time;
        next.partner = hit.wall;
    }
    var bounce = NOTHING;
    var bounce_id = NOTHING;
    let end = next.begin + next.count;
    for (var k = next.begin; k < end; k++) {
        let other = neighbors[k] & ~PASSES;
        if ((neighbors[k] & PASSES) != 0u) {
            let id = movers[other].id;
            if (id >= next.bounces_from && id < bounce_id) {
                bounce = neighbors[k];
                bounce_id = id;
            }
        } else if (is_stale || next_events[other].happens != 0u) {
            let time = collision_time_by_id(mover, movers[other]);
            if (time < NEVER && is_before(time, other, next)) {
                next.time = time;
                next.partner = other;
            }
        }
    }
    if (bounce != NOTHING) {
        next.time = window.now;
        next.partner = bounce;
    }
    next_events[at].time = next.time;
    next_events[at].partner = next.partner;
    return next.time;
}

@compute @workgroup_size(256)
fn collisions_predict(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                      @builtin(local_invocation_index) local_index: u32) {
    if (local_index == 0u) {
        atomicStore(&earliest, LATER);
    }
    workgroupBarrier();
    let at = global_index(group, groups, local_index);
    if (at < window.count && !is_over(1u - round.source)) {
        atomicMin(&earliest, bitcast<u32>(predict(at)));
    }
    workgroupBarrier();
    if (local_index == 0u) {
        atomicMin(&window.earliest[round.source], atomicLoad(&earliest));
    }
}
