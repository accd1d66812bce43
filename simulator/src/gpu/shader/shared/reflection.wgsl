// See reflection.rs.

// A sphere, relative to the path's beginning.
struct Obstacle {
    offset: vec3<f32>,
    radius: f32,
    displacement: vec3<f32>,
    // Drift in a step; velocities are reflected in its frame.
    drift: vec3<f32>,
    receiver: u32,
}

// `after` is the confined end, `first` the first receiver or NOTHING, `contact` the first contact, and `last` a step's
// displacement along the last segment.
struct ReflectedPath {
    end: vec3<f32>,
    after: vec3<f32>,
    first: u32,
    length: f32,
    velocity: vec3<f32>,
    contact: vec3<f32>,
    last: vec3<f32>,
}

// Maximum spheres and images near a particle; the run halts above.
const MAX_NEAR: u32 = 16u;
// A particle stops at the last reflection.
const BOUNCES: u32 = 64u;
// Bounds the lengthening of a path by rounding.
const ROUNDING_FACTOR: f32 = 1.00001;

var<private> near: array<Obstacle, MAX_NEAR>;
var<private> near_count: u32;
// The path left the region of all searches.
var<private> left_region: bool;

fn add_obstacle(obstacle: Obstacle, search_distance: f32) {
    let distance = length(obstacle.offset);
    if (distance > obstacle.radius + search_distance + 4e-6 * (distance + obstacle.radius)) {
        return;
    }
    if (near_count < MAX_NEAR) {
        near[near_count] = obstacle;
    }
    near_count++;
}

// Lists the spheres within `search_distance` of the beginning that do not contain it. In periodic space, the image
// nearest to the end is another obstacle.
fn search_surfaces(kind: SpeciesRow, path: Path, displacement: vec3<f32>, search_distance: f32) {
    near_count = 0u;
    let near_receivers = receivers_near(kind, path.before, search_distance);
    for (var k = near_receivers.begin; k < near_receivers.end; k++) {
        let event = event_rows[event_at(near_receivers, k)];
        if (event.kind < REFLECTING) {
            continue;
        }
        let receiver = receiver_at(event.receiver, control.step);
        if (signed_distance(event.radius, receiver.center, path.before) < 0.0 || is_separated(kind, path.after, receiver.center)) {
            continue;
        }
        let offset = minimum_image(path.before - receiver.center);
        add_obstacle(Obstacle(offset, event.radius, receiver.displacement, event.drift, event.receiver), search_distance);
        let relative = displacement - receiver.displacement;
        let other = minimum_image(path.before - receiver.center + relative) - relative;
        if (any(abs(other - offset) > vec3(event.radius))) {
            add_obstacle(Obstacle(other, event.radius, receiver.displacement, event.drift, event.receiver), search_distance);
        }
    }
}

// Above 1 without a hit.
fn time_to_hit(obstacle: Obstacle, traveled: vec3<f32>, time: f32, displacement: vec3<f32>) -> f32 {
    let out = obstacle.offset + traveled - time * obstacle.displacement;
    let relative = displacement - obstacle.displacement;
    let distance = length(out);
    let b = dot(out, relative);
    // Rounding may have left it inside.
    let c = max((distance - obstacle.radius) * (distance + obstacle.radius), 0.0);
    let root = b * b - dot(relative, relative) * c;
    if (b >= 0.0 || root < 0.0) {
        return 2.0;
    }
    return c / (sqrt(root) - b);
}

// MAX_NEAR if none contains the point at the end of the step.
fn obstacle_at(point: vec3<f32>, count: u32) -> u32 {
    for (var j = 0u; j < count; j++) {
        let receiver = receiver_at(near[j].receiver, control.step);
        if (signed_distance(near[j].radius, receiver.center + receiver.displacement, point) < 0.0) {
            return j;
        }
    }
    return MAX_NEAR;
}

// See reflection.rs.
fn outside(before: vec3<f32>, after: vec3<f32>, radius: f32, count: u32) -> vec3<f32> {
    if (obstacle_at(after, count) == MAX_NEAR) {
        return after;
    }
    let inside = obstacle_at(before, count);
    if (inside == MAX_NEAR) {
        return before;
    }
    let receiver = receiver_at(near[inside].receiver, control.step);
    let center = receiver.center + receiver.displacement;
    let out = minimum_image(before - center);
    let factor = near[inside].radius / max(length(out), 1e-37) * (1.0 + 1e-5);
    return confined(center + factor * out, radius);
}

struct FollowedPath {
    displacement: vec3<f32>,
    length: f32,
    first: u32,
    velocity: vec3<f32>,
    contact: vec3<f32>,
    last: vec3<f32>,
}

fn follow(start: vec3<f32>, velocity: vec3<f32>, count: u32) -> FollowedPath {
    var displacement = start;
    var found = FollowedPath(vec3(0.0), 0.0, NOTHING, velocity, vec3(0.0), start);
    var time = 0.0;
    for (var bounce = 0u; bounce < BOUNCES; bounce++) {
        var remaining = 1.0 - time;
        var next = MAX_NEAR;
        for (var j = 0u; j < count; j++) {
            let later = time_to_hit(near[j], found.displacement, time, displacement);
            if (later < remaining) {
                remaining = later;
                next = j;
            }
        }
        found.displacement += remaining * displacement;
        found.length += remaining * length(displacement);
        if (next == MAX_NEAR) {
            break;
        }
        if (found.first == NOTHING) {
            found.first = near[next].receiver;
            found.contact = found.displacement;
        }
        time += remaining;
        let normal = normalize(near[next].offset + found.displacement - time * near[next].displacement);
        displacement -= 2.0 * dot(displacement - near[next].displacement, normal) * normal;
        found.velocity -= 2.0 * dot(found.velocity - near[next].drift, normal) * normal;
    }
    found.last = displacement;
    return found;
}

fn reflect_path(kind: SpeciesRow, path: Path) -> ReflectedPath {
    let displacement = select(path.end, path.after, params.axes == vec3(1u)) - path.before;
    var found = FollowedPath(vec3(0.0), length(displacement), NOTHING, vec3(0.0), vec3(0.0), displacement);
    left_region = true;
    for (var query = 0u; query < params.max_requeries; query++) {
        // An approaching sphere accelerates the particle by at most twice its own speed.
        let search_distance = ROUNDING_FACTOR * found.length + 3.0 * trajectory.max_displacement;
        search_surfaces(kind, path, displacement, search_distance);
        found = follow(displacement, path.velocity * params.time_step, min(near_count, MAX_NEAR));
        // A moving sphere may push the particle beyond the searched region.
        if (trajectory.max_displacement == 0.0 || found.length + trajectory.max_displacement <= search_distance) {
            left_region = false;
            break;
        }
    }
    let end = path.before + found.displacement;
    if (found.first == NOTHING) {
        return ReflectedPath(path.end, path.after, NOTHING, found.length, path.velocity, path.before, displacement);
    }
    let count = min(near_count, MAX_NEAR);
    let after = outside(path.before, confined(end, kind.radius), kind.radius, count);
    let contact = path.before + found.contact;
    let velocity = found.velocity / params.time_step;
    return ReflectedPath(end, after, found.first, found.length, velocity, contact, found.last);
}
