// See vessel.rs.
const NO_VESSEL: u32 = 0u;

// Zeros for a sphere.
fn along_vessel() -> vec3<f32> {
    return select(vec3(0.0), vec3(1.0), vec3(1u, 2u, 3u) == vec3(params.vessel_axis));
}

fn across(v: vec3<f32>) -> vec3<f32> {
    return select(v, vec3(0.0), vec3(1u, 2u, 3u) == vec3(params.vessel_axis));
}

const VESSEL_REFLECTIONS: u32 = 64u;
// Fraction by which a point that rounding left outside moves inward, doubled each time.
const SHRINK: f32 = 2e-7;
const SHRINK_STEPS: u32 = 15u;

fn across_vessel(p: vec3<f32>) -> vec3<f32> {
    return across(p - params.vessel_center);
}

// Moves `p` to an offset, at most `radius` from the axis.
fn placed_across(p: vec3<f32>, offset: vec3<f32>, radius: f32) -> vec3<f32> {
    var q = p;
    var shrink = 0.0;
    for (var k = 0u; k < SHRINK_STEPS; k++) {
        q = select(params.vessel_center + (1.0 - shrink) * offset, p, along_vessel() == vec3(1.0));
        if (length(across_vessel(q)) <= radius) {
            break;
        }
        shrink = max(2.0 * shrink, SHRINK);
    }
    return q;
}

// Mirrors a point beyond the wall until it is inside, along the line through the axis or center.
fn confined_in_vessel(p: vec3<f32>, radius: f32) -> vec3<f32> {
    let offset = across_vessel(p);
    let distance = length(offset);
    if (distance <= radius) {
        return p;
    }
    let way = distance + radius;
    let rest = way - 4.0 * radius * floor(way / (4.0 * radius));
    return placed_across(p, offset * ((radius - abs(2.0 * radius - rest)) / distance), radius);
}

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
    var turned = velocity;
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
        turned -= 2.0 * dot(turned, normal) * normal;
    }
    return VesselPath(placed_across(end, at, radius), turned);
}

// The mean of both ends, to second order in the time step.
fn flow_between(before: vec3<f32>, end: vec3<f32>) -> f32 {
    let r = vec2(length(across_vessel(before)), length(across_vessel(end))) / params.vessel_radius;
    return params.peak_flow * 0.5 * ((1.0 - r.x * r.x) + (1.0 - r.y * r.y));
}
