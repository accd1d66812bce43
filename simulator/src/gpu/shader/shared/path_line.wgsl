// Lines that walls reflect; see path_hit.rs.

// Segments between walls and changes of the receiver's nearest image; steps with more are far too long.
const LINE_SEGMENTS: u32 = 3000u;
// Larger relative differences are not due to rounding.
const TURNED: f32 = 1e-5;

struct Line {
    start: vec3<f32>,
    displacement: vec3<f32>,
    begin: f32,
    fraction: f32,
}

// The next plane of each axis that cuts a line, in periods. Axes without cuts have no speed.
struct Cuts {
    planes: vec3<f32>,
    origin: vec3<f32>,
    period: vec3<f32>,
    start: vec3<f32>,
    speed: vec3<f32>,
}

fn first_cuts(line: Line, center: vec3<f32>, moved: vec3<f32>, radius: f32) -> Cuts {
    let is_periodic = params.axes == vec3(2u);
    let inset = select(vec3(0.0), vec3(radius), params.axes == vec3(1u));
    let low = params.low + inset;
    let period = params.high - inset - low;
    let origin = select(low, center + 0.5 * period, is_periodic);
    let relative = select(line.displacement, line.displacement - moved, is_periodic);
    let speed = select(vec3(0.0), relative, is_periodic | (params.axes == vec3(1u)));
    let at = (line.start - origin) / period;
    return Cuts(select(floor(at), ceil(at), speed > vec3(0.0)), origin, period, line.start, speed);
}

fn cut_times(cuts: Cuts) -> vec3<f32> {
    let safe = select(cuts.speed, vec3(1.0), cuts.speed == vec3(0.0));
    let times = (cuts.origin + cuts.planes * cuts.period - cuts.start) / safe;
    return select(times, vec3(2.0), cuts.speed == vec3(0.0));
}

// A fraction of the step; above 1 without an entry.
fn line_entry(event: EventRow, receiver: ReceiverRow, line: Line, radius: f32) -> f32 {
    let moved = line.fraction * receiver.displacement;
    let center = receiver.center + line.begin * receiver.displacement;
    var cuts = first_cuts(line, center, moved, radius);
    var time = 0.0;
    for (var k = 0u; k < LINE_SEGMENTS; k++) {
        let times = cut_times(cuts);
        let next = min(times.x, min(times.y, times.z));
        let until = clamp(next, time, 1.0);
        let middle = 0.5 * (time + until);
        let cut_fraction = until - time;
        let point = line.start + middle * line.displacement;
        let cut_displacement = cut_fraction * select(line.displacement, -line.displacement, reversed_axes(point, radius));
        let relative = cut_displacement - cut_fraction * moved;
        let at = minimum_image(confined(point, radius) - (center + middle * moved)) - 0.5 * relative;
        if (dot(at, at) <= event.radius * event.radius) {
            return line.begin + line.fraction * time;
        }
        let entry = entry_time(at, relative, event.radius);
        if (entry <= 1.0) {
            return line.begin + line.fraction * (time + cut_fraction * entry);
        }
        if (next >= 1.0) {
            break;
        }
        time = until;
        cuts.planes += select(vec3(0.0), sign(cuts.speed), times == vec3(next));
    }
    return 2.0;
}

// A fraction of the displacement; above 1 without a reflection.
fn time_to_side(at: vec3<f32>, displacement: vec3<f32>, radius: f32) -> f32 {
    let distance = length(at);
    let a = dot(displacement, displacement);
    let b = dot(at, displacement);
    let c = min((distance - radius) * (distance + radius), 0.0);
    let root = sqrt(max(b * b - a * c, 0.0));
    if (a == 0.0) {
        return 2.0;
    }
    if (b > 0.0) {
        return -c / (b + root);
    }
    return (root - b) / a;
}

// True if only the vessel's wall reflects the path to `free_end`, across the vessel.
fn turns_at_side(path: Path, free_end: vec3<f32>, radius: f32) -> bool {
    if (params.vessel_axis == NO_VESSEL) {
        return false;
    }
    if (length(across_vessel(free_end)) <= radius) {
        return false;
    }
    let reflected = reflect_in_vessel(path.before, free_end, radius, vec3(0.0)).end;
    let scale = radius + length(path.before) + length(free_end - path.before);
    return length(across(reflected - path.end)) <= TURNED * scale;
}

fn line_time(event: EventRow, receiver: ReceiverRow, path: Path, radius: f32) -> f32 {
    let inset = params.vessel_radius - radius;
    if (!turns_at_side(path, path.before + path.drift, inset)) {
        return line_entry(event, receiver, Line(path.before, path.end - path.before, 0.0, 1.0), radius);
    }
    let along = path.drift - across(path.drift);
    var start = path.before;
    var displacement = across(path.drift);
    var begin = 0.0;
    for (var k = 0u; k <= VESSEL_REFLECTIONS; k++) {
        let rest = 1.0 - begin;
        let time = min(time_to_side(across_vessel(start), displacement, inset), 1.0);
        let line = Line(start, time * (displacement + rest * along), begin, time * rest);
        let entry = line_entry(event, receiver, line, radius);
        if (entry <= 1.0) {
            return entry;
        }
        if (time >= 1.0) {
            break;
        }
        start += line.displacement;
        begin += line.fraction;
        let normal = across_vessel(start) / inset;
        displacement *= 1.0 - time;
        displacement -= 2.0 * dot(displacement, normal) * normal;
    }
    return 2.0;
}
