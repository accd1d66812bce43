// The path of a particle in a step, and tests whether it hit a receiver, as in propagate.rs and path_hit.rs.
fn path_of(before: vec3<f32>, velocity: vec3<f32>, kind: SpeciesRow, id: u32) -> Path {
    let random = normals(philox(vec4(id, 0u, control.step, PURPOSE_MOVE), params.key));
    var end = before + (kind.length * random + (kind.drift + velocity * params.time_step));
    if (params.vessel_axis == NO_VESSEL) {
        if (kind.length > 0.0 && kind.speed == 0.0 && kind.thermal_speed == 0.0) {
            end = reflected_at_walls(before, end, kind, id);
        }
        let own = select(velocity, -velocity, reversed_axes(end, kind.radius));
        return Path(before, end, confined(end, kind.radius), own);
    }
    let reflected = reflect_in_vessel(before, end, params.vessel_radius - kind.radius, velocity);
    var carried = reflected.end;
    carried[along_vessel()] += flow_between(before, reflected.end);
    let own = select(reflected.velocity, -reflected.velocity, reversed_axes(carried, kind.radius));
    return Path(before, carried, confined_axes(carried, kind.radius), own);
}

fn velocity_of(at: u32, kind: SpeciesRow, id: u32) -> vec3<f32> {
    if (params.has_velocity == 0u) {
        return vec3(0.0);
    }
    if (kind.tumbles != 0u) {
        let words = philox(vec4(id, 0u, control.step, PURPOSE_TUMBLE), params.key);
        if (words.x <= kind.tumble_threshold) {
            return kind.speed * direction(words.y, words.z);
        }
    }
    return spheres[velocity_at(at)].xyz;
}

// Returns the end of a step after reflection at the walls along which the particle drifts.
fn reflected_at_walls(before: vec3<f32>, end: vec3<f32>, kind: SpeciesRow, id: u32) -> vec3<f32> {
    let drifts = (kind.drift != vec3(0.0)) & (params.axes == vec3(1u));
    if (!any(drifts)) {
        return end;
    }
    let words = philox(vec4(id, 0u, control.step, PURPOSE_WALL), params.key);
    var reflected = end;
    for (var k = 0u; k < 3u; k++) {
        if (drifts[k]) {
            let low = params.low[k] + kind.radius;
            let high = params.high[k] - kind.radius;
            reflected[k] = reflected_at_wall(low, high, vec2(before[k], end[k]), kind.length, words[k]);
        }
    }
    return reflected;
}

// A hit of a path on a receiver: the time of a certain one, or heights above the surface at both ends, in units of
// sqrt(2 D dt), from which a time is drawn.
struct Hit {
    is_hit: bool,
    is_drawn: bool,
    time: f32,
    heights: vec2<f32>,
}

fn hit_at(is_hit: bool, time: f32) -> Hit {
    return Hit(is_hit, false, time, vec2(0.0));
}

// Returns the fraction of a path along a line at which it enters the sphere, in the frame of the sphere; above 1 if it does not.
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

fn hit_of(event: EventRow, receiver: ReceiverRow, path: Path, own_diffusion: f32, id: u32) -> Hit {
    let b = signed_distance(event.radius, receiver.center + receiver.displacement, path.after);
    if (event.kind == ENDPOINT) {
        return hit_at(b <= 0.0, 1.0);
    }
    let a = signed_distance(event.radius, receiver.center, path.before);
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
        let probability = hit_probability(event.radius, a, b, diffusion);
        is_hit = probability > 0.0
            && open_unit(philox(vec4(id, event.receiver, control.step, PURPOSE_RECEIVER), params.key).x) < probability;
    }
    return Hit(is_hit, true, 0.0, vec2(a, b) / sqrt(2.0 * diffusion));
}

// Returns the fraction of the step at which a path first hit a receiver.
fn time_of(hit: Hit, receiver: u32, id: u32) -> f32 {
    if (!hit.is_drawn) {
        return hit.time;
    }
    let words = philox(vec4(id, receiver, control.step, PURPOSE_HIT_TIME), params.key);
    return first_passage(hit.heights, normals(words).x, open_unit(words.z));
}

// Returns true if a hit on a receiver comes before the first one so far, of the event at first.
fn is_earlier(hit: Hit, receiver: u32, first_hit: Hit, first: u32, id: u32) -> bool {
    if (first == NOTHING) {
        return true;
    }
    return time_of(hit, receiver, id) < time_of(first_hit, event_rows[first].receiver, id);
}
