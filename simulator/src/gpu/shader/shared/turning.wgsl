// Ways that surfaces turn back, as turning.rs has them.

// A sphere that may be in the way of a particle, seen from where both begin.
struct Obstacle {
    // From the centre to the particle.
    offset: vec3<f32>,
    radius: f32,
    way: vec3<f32>,
    receiver: u32,
}

// Where a way goes that was turned back, and by whom first; NOTHING where it was not.
struct Turned {
    end: vec3<f32>,
    after: vec3<f32>,
    first: u32,
    // How long the way is.
    gone: f32,
}

// Spheres and images of spheres that one particle may meet in a step, at most: the run freezes if there are more.
const NEAR: u32 = 16u;
// Bounces of one step, at most; a particle that is about to have more stays where the last one is.
const BOUNCES: u32 = 64u;
// By how much rounding may lengthen a way, and more.
const LONGER: f32 = 1.00001;

var<private> near: array<Obstacle, NEAR>;
var<private> near_count: u32;
// Whether it went beyond the spheres that are listed in the end: the run freezes then as well.
var<private> thrown_too_far: bool;

fn note(obstacle: Obstacle, reach: f32) {
    let distance = length(obstacle.offset);
    if (distance > obstacle.radius + reach + 4e-6 * (distance + obstacle.radius)) {
        return;
    }
    if (near_count < NEAR) {
        near[near_count] = obstacle;
    }
    near_count++;
}

// Lists the spheres that the particle is outside of and that lie within such a reach of where it begins. Where space repeats
// the image that is nearest to the end of its way is another obstacle.
fn look_around(kind: Kind, path: Path, way: vec3<f32>, reach: f32) {
    near_count = 0u;
    let seen = seen_by(kind, path.before, reach);
    for (var k = seen.begin; k < seen.end; k++) {
        let fate = fates[fate_at(seen, k)];
        if (fate.kind < REFLECTING) {
            continue;
        }
        let body = body_in(fate.receiver, control.step);
        if (height(fate.radius, body.center, path.before) < 0.0) {
            continue;
        }
        let offset = nearest(path.before - body.center);
        note(Obstacle(offset, fate.radius, body.way, fate.receiver), reach);
        let relative = way - body.way;
        let other = nearest(path.before - body.center + relative) - relative;
        if (any(abs(other - offset) > vec3(fate.radius))) {
            note(Obstacle(other, fate.radius, body.way, fate.receiver), reach);
        }
    }
}

// How much later a particle on this way meets it that is outside now; more than a step where it does not.
fn meeting(obstacle: Obstacle, gone: vec3<f32>, time: f32, way: vec3<f32>) -> f32 {
    let out = obstacle.offset + gone - time * obstacle.way;
    let relative = way - obstacle.way;
    let distance = length(out);
    let b = dot(out, relative);
    // Rounding may have left it a little inside.
    let c = max((distance - obstacle.radius) * (distance + obstacle.radius), 0.0);
    let root = b * b - dot(relative, relative) * c;
    if (b >= 0.0 || root < 0.0) {
        return 2.0;
    }
    return c / (sqrt(root) - b);
}

// The obstacle at the end of the step in which a point is; NEAR if there is none.
fn holder_of(point: vec3<f32>, count: u32) -> u32 {
    for (var j = 0u; j < count; j++) {
        let body = body_in(near[j].receiver, control.step);
        if (height(near[j].radius, body.center + body.way, point) < 0.0) {
            return j;
        }
    }
    return NEAR;
}

// The end of a way, or its beginning where walls or rounding brought the end into a sphere. A sphere that comes over both
// pushes the particle before it.
fn outside(before: vec3<f32>, after: vec3<f32>, radius: f32, count: u32) -> vec3<f32> {
    if (holder_of(after, count) == NEAR) {
        return after;
    }
    let holder = holder_of(before, count);
    if (holder == NEAR) {
        return before;
    }
    let body = body_in(near[holder].receiver, control.step);
    let center = body.center + body.way;
    let out = nearest(before - center);
    let factor = near[holder].radius / max(length(out), 1e-37) * (1.0 + 1e-5);
    return placed(center + factor * out, radius);
}

// A way from bounce to bounce.
struct Way {
    // Where it goes, from its beginning.
    gone: vec3<f32>,
    // How long it is.
    length: f32,
    first: u32,
}

// Follows a way past the spheres that are listed.
fn followed(begun: vec3<f32>, count: u32) -> Way {
    var way = begun;
    var found = Way(vec3(0.0), 0.0, NOTHING);
    var time = 0.0;
    for (var bounce = 0u; bounce < BOUNCES; bounce++) {
        var soonest = 1.0 - time;
        var next = NEAR;
        for (var j = 0u; j < count; j++) {
            let later = meeting(near[j], found.gone, time, way);
            if (later < soonest) {
                soonest = later;
                next = j;
            }
        }
        found.gone += soonest * way;
        found.length += soonest * length(way);
        if (next == NEAR) {
            break;
        }
        if (found.first == NOTHING) {
            found.first = near[next].receiver;
        }
        time += soonest;
        let normal = normalize(near[next].offset + found.gone - time * near[next].way);
        way -= 2.0 * dot(way - near[next].way, normal) * normal;
    }
    return found;
}

fn turned_back(kind: Kind, path: Path) -> Turned {
    // Walls have turned the way where it has gone through them.
    let way = select(path.end, path.after, params.axes == vec3(1u)) - path.before;
    var found = Way(vec3(0.0), length(way), NOTHING);
    thrown_too_far = true;
    for (var look = 0u; look < params.looks; look++) {
        // What comes towards it makes it faster at a bounce, by twice as much.
        let reach = LONGER * found.length + 3.0 * journey.longest;
        look_around(kind, path, way, reach);
        found = followed(way, min(near_count, NEAR));
        // Where something comes, it may have been thrown beyond what was looked at.
        if (journey.longest == 0.0 || found.length + journey.longest <= reach) {
            thrown_too_far = false;
            break;
        }
    }
    let end = path.before + found.gone;
    if (found.first == NOTHING) {
        return Turned(path.end, path.after, NOTHING, found.length);
    }
    let count = min(near_count, NEAR);
    return Turned(end, outside(path.before, placed(end, kind.radius), kind.radius, count), found.first, found.length);
}
