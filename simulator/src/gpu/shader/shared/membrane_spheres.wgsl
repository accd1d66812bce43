// See membrane/sphere.rs.
#include erfcx

// Crossings and reflections per step; then a particle stays at its beginning.
const MEMBRANE_EVENTS: u32 = 64u;
const NUDGES: u32 = 8u;

struct MembraneSphere {
    center: vec3<f32>,
    radius: f32,
    // 2 kappa sqrt(dt / D).
    own: f32,
    membrane: u32,
    // Below this distance from the surface, rounding may change the side.
    rounding: f32,
}

// The rest of a step.
struct Ray {
    at: vec3<f32>,
    displacement: vec3<f32>,
    walls: vec3<f32>,
    // 1 for axes whose walls reflected it.
    mirrors: vec3<f32>,
}

struct Crossing {
    fraction: f32,
    normal: vec3<f32>,
    index: u32,
    is_wall: bool,
}

// Bits of the spheres that contain the ray, at most 100.
var<private> inside: array<u32, 4>;

fn membrane_sphere(kind: SpeciesRow, k: u32) -> MembraneSphere {
    let row = scene_rows[kind.membrane_spheres.x + 2u * k];
    let more = scene_rows[kind.membrane_spheres.x + 2u * k + 1u];
    let sphere = bitcast<vec4<f32>>(row);
    return MembraneSphere(sphere.xyz, sphere.w, bitcast<f32>(more.x), more.y, bitcast<f32>(more.z));
}

fn height_above(sphere: MembraneSphere, point: vec3<f32>) -> f32 {
    return length(minimum_image(point - sphere.center)) - sphere.radius;
}

fn is_inside(k: u32) -> bool {
    return (inside[k / 32u] & (1u << (k % 32u))) != 0u;
}

fn is_across_sphere(kind: SpeciesRow, a: vec3<f32>, b: vec3<f32>) -> bool {
    for (var k = 0u; k < kind.membrane_spheres.y; k++) {
        let sphere = membrane_sphere(kind, k);
        if ((height_above(sphere, a) < 0.0) != (height_above(sphere, b) < 0.0)) {
            return true;
        }
    }
    return false;
}

// The fraction of a displacement that reaches a surface, or above 1.
fn time_to_surface(radius: f32, is_within: bool, start: vec3<f32>, displacement: vec3<f32>) -> f32 {
    let a = dot(displacement, displacement);
    let b = dot(start, displacement);
    let distance = length(start);
    let c = (distance - radius) * (distance + radius);
    if (a == 0.0) {
        return 2.0;
    }
    if (is_within) {
        let root = sqrt(b * b - a * min(c, 0.0));
        if (b > 0.0) {
            return -min(c, 0.0) / (b + root);
        }
        return (root - b) / a;
    }
    let square = b * b - a * max(c, 0.0);
    if (b >= 0.0 || square < 0.0) {
        return 2.0;
    }
    return max(c, 0.0) / (sqrt(square) - b);
}

fn next_wall(ray: Ray, radius: f32) -> Crossing {
    var next = Crossing(1.0, vec3(0.0), NOTHING, true);
    for (var axis = 0u; axis < 3u; axis++) {
        let along = ray.displacement[axis];
        if (params.axes[axis] != 1u || along == 0.0) {
            continue;
        }
        let wall = select(params.high[axis] - radius, params.low[axis] + radius, along < 0.0);
        let fraction = max((wall - ray.at[axis]) / along, 0.0);
        if (fraction < next.fraction) {
            next = Crossing(fraction, vec3(wall), axis, true);
        }
    }
    return next;
}

fn next_crossing(ray: Ray, kind: SpeciesRow) -> Crossing {
    var next = next_wall(ray, kind.radius);
    let periods = select(vec3(0.0), sign(ray.displacement) * (params.high - params.low), params.axes == vec3(2u));
    let images = select(1u, 8u, any(params.axes == vec3(2u)));
    for (var k = 0u; k < kind.membrane_spheres.y; k++) {
        let sphere = membrane_sphere(kind, k);
        let nearest = minimum_image(ray.at - sphere.center);
        // A ray reaches images ahead of it, unless it begins in the sphere.
        for (var image = 0u; image < images; image++) {
            let shift = vec3<f32>((vec3(image) >> vec3(0u, 1u, 2u)) & vec3(1u));
            let start = nearest - shift * periods;
            if (image > 0u && (is_inside(k) || any((shift > vec3(0.0)) & (periods == vec3(0.0))))) {
                continue;
            }
            let fraction = time_to_surface(sphere.radius, is_inside(k), start, ray.displacement);
            if (fraction < next.fraction) {
                next = Crossing(fraction, normalize(start + fraction * ray.displacement), k, false);
            }
        }
    }
    return next;
}

fn is_on_right_sides(kind: SpeciesRow, point: vec3<f32>) -> bool {
    for (var k = 0u; k < kind.membrane_spheres.y; k++) {
        let sphere = membrane_sphere(kind, k);
        if (select(1.0, -1.0, is_inside(k)) * height_above(sphere, point) < sphere.rounding) {
            return false;
        }
    }
    return true;
}

// A displacement from the nearest surface to the right side, beyond rounding.
fn nudge(kind: SpeciesRow, point: vec3<f32>) -> vec3<f32> {
    var nearest = 1e38;
    var found = vec3(0.0);
    for (var k = 0u; k < kind.membrane_spheres.y; k++) {
        let sphere = membrane_sphere(kind, k);
        let gap = abs(height_above(sphere, point));
        if (gap < nearest) {
            nearest = gap;
            let out = minimum_image(point - sphere.center);
            found = select(1.0, -1.0, is_inside(k)) * sphere.rounding / max(length(out), 1e-37) * out;
        }
    }
    return found;
}

// The beginning if no near sphere is on the right sides.
fn end_of(ray: Ray, start: Path, kind: SpeciesRow) -> Path {
    var point = ray.at;
    let unit = nudge(kind, ray.at);
    for (var k = 0u; k <= NUDGES; k++) {
        let after = confined(point, kind.radius);
        if (is_on_right_sides(kind, after)) {
            let free = select(point, 2.0 * ray.walls - point, ray.mirrors > vec3(0.0));
            return Path(start.before, free, after, start.velocity, free, start.drift);
        }
        point = ray.at + f32(2u << k) * unit;
    }
    return at_rest(start);
}

// Sets `inside`.
fn may_reach_sphere(kind: SpeciesRow, path: Path) -> bool {
    let path_length = length(path.free_end - path.before) * (1.0 + 1e-6);
    var is_near = false;
    inside = array<u32, 4>();
    for (var k = 0u; k < kind.membrane_spheres.y; k++) {
        let height = height_above(membrane_sphere(kind, k), path.before);
        is_near = is_near || abs(height) <= path_length;
        if (height < 0.0) {
            inside[k / 32u] |= 1u << (k % 32u);
        }
    }
    return is_near && path_length > 0.0;
}

fn hold_back_by_spheres(path: Path, kind: SpeciesRow, id: u32) -> Path {
    var ray = Ray(path.before, path.free_end - path.before, vec3(0.0), vec3(0.0));
    let segment = length(ray.displacement);
    for (var event = 0u; event < MEMBRANE_EVENTS; event++) {
        let next = next_crossing(ray, kind);
        ray.at += next.fraction * ray.displacement;
        if (next.index == NOTHING) {
            return end_of(ray, path, kind);
        }
        ray.displacement *= 1.0 - next.fraction;
        if (next.is_wall) {
            ray.walls = with_component(ray.walls, next.index, next.normal.x);
            ray.mirrors = with_component(ray.mirrors, next.index, 1.0);
            ray.displacement = with_component(ray.displacement, next.index, -ray.displacement[next.index]);
            continue;
        }
        let sphere = membrane_sphere(kind, next.index);
        let out = dot(ray.displacement, next.normal);
        let cosine = abs(out) / max(length(ray.displacement), 1e-37);
        // sqrt(4 D dt) is sqrt(2) standard deviations.
        let distances = segment * cosine / (1.4142135623730951 * kind.length);
        let passes = ROOT_PI * sphere.own * erfcx(sphere.own + distances);
        let word = philox(vec4(id, sphere.membrane, control.step, PURPOSE_MEMBRANE | (event << 8u)), params.key).x;
        if (unit_32(word) < passes) {
            inside[next.index / 32u] ^= 1u << (next.index % 32u);
        } else {
            ray.displacement -= 2.0 * out * next.normal;
        }
    }
    return at_rest(path);
}
