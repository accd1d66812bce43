// A circular vessel, as in vessel.rs, in f32.
const NO_VESSEL: u32 = 0u;

fn along_vessel() -> u32 {
    return params.vessel_axis - 1u;
}

// Most reflections of a step; a particle stops at the last.
const VESSEL_REFLECTIONS: u32 = 64u;
// A point that rounding left outside moves towards the axis by this fraction, doubled each time.
const SHRINK: f32 = 2e-7;
const SHRINK_STEPS: u32 = 15u;

fn first_across() -> u32 {
    return (along_vessel() + 1u) % 3u;
}

fn second_across() -> u32 {
    return (along_vessel() + 2u) % 3u;
}

fn across_vessel(p: vec3<f32>) -> vec2<f32> {
    let d = p - params.vessel_center;
    return vec2(d[first_across()], d[second_across()]);
}

// At most `radius` from the axis.
fn placed_across(p: vec3<f32>, across: vec2<f32>, radius: f32) -> vec3<f32> {
    var q = p;
    var shrink = 0.0;
    for (var k = 0u; k < SHRINK_STEPS; k++) {
        q[first_across()] = params.vessel_center[first_across()] + (1.0 - shrink) * across.x;
        q[second_across()] = params.vessel_center[second_across()] + (1.0 - shrink) * across.y;
        if (length(across_vessel(q)) <= radius) {
            break;
        }
        shrink = max(2.0 * shrink, SHRINK);
    }
    return q;
}

// A point far beyond the wall goes to the axis.
fn confined_in_vessel(p: vec3<f32>, radius: f32) -> vec3<f32> {
    let across = across_vessel(p);
    let distance = length(across);
    if (distance <= radius) {
        return p;
    }
    return placed_across(p, across * (max(2.0 * radius - distance, 0.0) / distance), radius);
}

// The end of a path across the vessel, and the velocity after its reflections.
struct VesselPath {
    end: vec3<f32>,
    velocity: vec3<f32>,
}

fn reflect_in_vessel(before: vec3<f32>, end: vec3<f32>, radius: f32, velocity: vec3<f32>) -> VesselPath {
    let to = across_vessel(end);
    if (length(to) <= radius) {
        return VesselPath(end, velocity);
    }
    var at = across_vessel(before);
    var displacement = to - at;
    at /= max(length(at) / radius, 1.0);
    var across = vec2(velocity[first_across()], velocity[second_across()]);
    for (var k = 0u; k < VESSEL_REFLECTIONS; k++) {
        // The later root of |at + t displacement| = radius, without cancellation.
        let distance = length(at);
        let a = dot(displacement, displacement);
        let b = dot(at, displacement);
        let c = min((distance - radius) * (distance + radius), 0.0);
        let root = sqrt(max(b * b - a * c, 0.0));
        var t = 1.0;
        if (a > 0.0) {
            if (b > 0.0) {
                t = -c / (b + root);
            } else {
                t = (root - b) / a;
            }
        }
        if (t >= 1.0) {
            at += displacement;
            break;
        }
        at += t * displacement;
        let normal = at / radius;
        displacement *= 1.0 - t;
        displacement -= 2.0 * dot(displacement, normal) * normal;
        across -= 2.0 * dot(across, normal) * normal;
    }
    var turned = velocity;
    turned[first_across()] = across.x;
    turned[second_across()] = across.y;
    return VesselPath(placed_across(end, at, radius), turned);
}

// Displacement by Poiseuille flow: the mean of both ends, to second order in the time step.
fn flow_between(before: vec3<f32>, end: vec3<f32>) -> f32 {
    let r = vec2(length(across_vessel(before)), length(across_vessel(end))) / params.vessel_radius;
    return params.peak_flow * 0.5 * ((1.0 - r.x * r.x) + (1.0 - r.y * r.y));
}
