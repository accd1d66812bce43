// See path_hit.rs.
#include path

// A fraction of the displacement; above 1 without an entry.
fn entry_time(start: vec3<f32>, displacement: vec3<f32>, radius: f32) -> f32 {
    let outside = dot(start, start) - radius * radius;
    let approach = -dot(start, displacement);
    let across = cross(start, displacement);
    let square = dot(displacement, displacement);
    let root = radius * radius * square - dot(across, across);
    if (approach <= 0.0 || root < 0.0) {
        return 2.0;
    }
    return outside / (approach + sqrt(root));
}

// Heights are negative inside. In one dimension, a segment to the other side ends inside.
fn heights_between(radius: f32, centers: mat2x3<f32>, ends: mat2x3<f32>) -> vec2<f32> {
    let a = signed_distance(radius, centers[0], ends[0]);
    let b = signed_distance(radius, centers[1], ends[1]);
    let from_x = minimum_image(ends[0] - centers[0]).x;
    let to_x = minimum_image(ends[1] - centers[1]).x;
    // Half a period away, the sides change, too.
    let is_opposite = params.axes.x == 2u && 2.0 * abs(from_x - to_x) > params.high.x - params.low.x;
    let passes = params.axes.y == FROZEN && from_x * to_x < 0.0 && !is_opposite;
    return vec2(a, select(b, -b - 2.0 * radius, passes));
}

fn heights_of(event: EventRow, receiver: ReceiverRow, path: Path) -> vec2<f32> {
    let centers = mat2x3(receiver.center, receiver.center + receiver.displacement);
    return heights_between(event.radius, centers, mat2x3(path.before, path.after));
}

// A radius without curvature or image.
const FLAT: f32 = 1e12;

// Numbers of segments begin at 0.
fn hits_sphere(event: EventRow, heights: vec2<f32>, diffusion: f32, id: u32, number: u32) -> bool {
    if (heights.y <= 0.0 || heights.x < 0.0) {
        return true;
    }
    let radius = select(event.radius, FLAT, params.axes.z == FROZEN);
    let probability = hit_probability(radius, heights.x, heights.y, diffusion);
    let counter = vec4(id, event.receiver, control.step, PURPOSE_RECEIVER | (number << 8u));
    return probability > 0.0 && open_unit(philox(counter, params.key).x) < probability;
}

#ifdef WITHOUT_LONG_PATHS
#include short_paths
#else
#include path_bridge
#include path_line
#endif

fn hit_of(event: EventRow, receiver: ReceiverRow, path: Path, kind: SpeciesRow, id: u32) -> Hit {
    if (event.kind == ENDPOINT) {
        return hit_at(signed_distance(event.radius, receiver.center + receiver.displacement, path.after) <= 0.0, 1.0);
    }
    let heights = heights_of(event, receiver, path);
    let diffusion = kind.diffusion + event.diffusion;
    if (diffusion == 0.0) {
        if (heights.x < 0.0) {
            return hit_at(true, 0.0);
        }
        let time = line_time(event, receiver, path, kind.radius);
        return hit_at(heights.y <= 0.0 || time <= 1.0, min(time, 1.0));
    }
    let spread = sqrt(2.0 * diffusion);
    let drift = length(path.drift - event.drift);
    if (is_long(drift, spread, event.radius)) {
        return bridge_hit(event, receiver, path, vec3(drift, spread, kind.radius), id);
    }
    return Hit(hits_sphere(event, heights, diffusion, id, 0u), 0.0, 1.0, heights / spread);
}

fn is_earlier(hit: Hit, receiver: u32, first_hit: Hit, first: u32, id: u32) -> bool {
    if (first == NOTHING) {
        return true;
    }
    return time_of(hit, receiver, id) < time_of(first_hit, event_rows[first].receiver, id);
}
