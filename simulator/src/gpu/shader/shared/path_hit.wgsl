// Hits of a particle's path on receivers, as in path_hit.rs.
#include path

// Returns the fraction of a line at which it enters the sphere, in its frame; above 1 if it does not.
fn entry_time(event: EventRow, receiver: ReceiverRow, path: Path) -> f32 {
    let start = minimum_image(path.before - receiver.center);
    let displacement = path.end - path.before - receiver.displacement;
    let outside = dot(start, start) - event.radius * event.radius;
    let approach = -dot(start, displacement);
    let across = cross(start, displacement);
    let square = dot(displacement, displacement);
    let root = event.radius * event.radius * square - dot(across, across);
    if (approach <= 0.0 || root < 0.0) {
        return 2.0;
    }
    return outside / (approach + sqrt(root));
}

// Returns the heights of both ends above the surface, negative inside. A path to the other side of a segment ends
// inside.
fn heights_of(event: EventRow, receiver: ReceiverRow, path: Path) -> vec2<f32> {
    let last = receiver.center + receiver.displacement;
    let a = signed_distance(event.radius, receiver.center, path.before);
    let b = signed_distance(event.radius, last, path.after);
    let sides = minimum_image(path.before - receiver.center).x * minimum_image(path.after - last).x;
    return vec2(a, select(b, -b - 2.0 * event.radius, params.axes.y == FROZEN && sides < 0.0));
}

// A radius without curvature or image.
const FLAT: f32 = 1e12;

fn hit_of(event: EventRow, receiver: ReceiverRow, path: Path, own_diffusion: f32, id: u32) -> Hit {
    if (event.kind == ENDPOINT) {
        return hit_at(signed_distance(event.radius, receiver.center + receiver.displacement, path.after) <= 0.0, 1.0);
    }
    let heights = heights_of(event, receiver, path);
    let a = heights.x;
    let b = heights.y;
    let diffusion = own_diffusion + event.diffusion;
    if (diffusion == 0.0) {
        if (a < 0.0) {
            return hit_at(true, 0.0);
        }
        let time = entry_time(event, receiver, path);
        return hit_at(b <= 0.0 || time <= 1.0, min(time, 1.0));
    }
    var is_hit = b <= 0.0 || a < 0.0;
    if (!is_hit) {
        let radius = select(event.radius, FLAT, params.axes.z == FROZEN);
        let probability = hit_probability(radius, a, b, diffusion);
        is_hit = probability > 0.0
            && open_unit(philox(vec4(id, event.receiver, control.step, PURPOSE_RECEIVER), params.key).x) < probability;
    }
    return Hit(is_hit, true, 0.0, vec2(a, b) / sqrt(2.0 * diffusion));
}

// Returns true if a hit precedes the hit so far of event `first`.
fn is_earlier(hit: Hit, receiver: u32, first_hit: Hit, first: u32, id: u32) -> bool {
    if (first == NOTHING) {
        return true;
    }
    return time_of(hit, receiver, id) < time_of(first_hit, event_rows[first].receiver, id);
}
