// See collisions/rules.rs.

// A time after both clocks, or NEVER. The lower id is first.
fn collision_time(a: Mover, b: Mover) -> f32 {
    let now = max(a.time, b.time);
    let d = displacement_at(a, b, now);
    let relative = b.motion - a.motion;
    let approach = -dot(d, relative);
    let speed = dot(relative, relative);
    let square = dot(d, d);
    let touch = a.radius + b.radius;
    // Rounding decides the sign of a grazing approach, which could recur without a threshold.
    if (approach <= GRAZING * sqrt(speed * square)) {
        return NEVER;
    }
    let distance = sqrt(square);
    let apart = max((distance - touch) * (distance + touch), 0.0);
    let root = approach * approach - speed * apart;
    if (root < 0.0) {
        return NEVER;
    }
    return now + apart / (approach + sqrt(root));
}

const GRAZING: f32 = 1e-6;

// One call for both orders: compilers may round two copies differently.
fn collision_time_by_id(a: Mover, b: Mover) -> f32 {
    var first = a;
    var second = b;
    if (b.id < a.id) {
        first = b;
        second = a;
    }
    return collision_time(first, second);
}

struct WallHit {
    time: f32,
    wall: u32,
}

fn wall_hit(mover: Mover) -> WallHit {
    var hit = WallHit(NEVER, NOTHING);
    let position = mover.base + mover.offset;
    for (var k = 0u; k < 3u; k++) {
        let speed = mover.motion[k];
        if (params.axes[k] != 1u || speed == 0.0) {
            continue;
        }
        let wall = select(params.low[k] + mover.radius, params.high[k] - mover.radius, speed > 0.0);
        let time = mover.time + max((wall - position[k]) / speed, 0.0);
        if (time < hit.time) {
            hit = WallHit(time, WALLS + 2u * k + select(0u, 1u, speed > 0.0));
        }
    }
    if (params.vessel_axis != NO_VESSEL) {
        let at = across_vessel(position);
        let motion = across(mover.motion);
        let radius = params.vessel_radius - mover.radius;
        let distance = length(at);
        let a = dot(motion, motion);
        let b = dot(at, motion);
        let c = min((distance - radius) * (distance + radius), 0.0);
        if (a > 0.0) {
            let root = sqrt(max(b * b - a * c, 0.0));
            var after = 0.0;
            if (b > 0.0) {
                after = -c / (b + root);
            } else {
                after = (root - b) / a;
            }
            if (mover.time + after < hit.time) {
                hit = WallHit(mover.time + after, VESSEL_WALL);
            }
        }
    }
    return hit;
}
