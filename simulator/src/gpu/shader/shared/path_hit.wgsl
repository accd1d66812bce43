// The path of a particle in a step, and tests whether it hit a receiver, as in motion.rs and crossing.rs.
fn path_of(before: vec3<f32>, velocity: vec3<f32>, kind: SpeciesRow, id: u32) -> Path {
    let random = normals(philox(vec4(id, 0u, control.step, PURPOSE_MOVE), params.key));
    let end = before + (kind.length * random + (kind.drift + velocity * params.time_step));
    if (params.vessel_axis == NO_VESSEL) {
        let own = select(velocity, -velocity, reversed_axes(end, kind.radius));
        return Path(before, end, confined(end, kind.radius), own);
    }
    let reflected = reflect_in_vessel(before, end, params.vessel_radius - kind.radius, velocity);
    var carried = reflected.end;
    carried[along_vessel()] += flow_between(before, reflected.end);
    let own = select(reflected.velocity, -reflected.velocity, reversed_axes(carried, kind.radius));
    return Path(before, carried, confined_axes(carried, kind.radius), own);
}

// Returns the velocity at the beginning of a step: a swimmer tumbles at random.
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

// Returns true if a straight path enters and leaves the sphere, in the frame of the sphere.
fn passes(event: EventRow, receiver: ReceiverRow, path: Path) -> bool {
    let start = minimum_image(path.before - receiver.center);
    let displacement = path.end - path.before - receiver.displacement;
    let across = cross(start, displacement);
    return dot(start, displacement) < 0.0 && dot(start + displacement, displacement) > 0.0
        && dot(across, across) <= event.radius * event.radius * dot(displacement, displacement);
}

fn meets(event: EventRow, receiver: ReceiverRow, path: Path, own_diffusion: f32, id: u32) -> bool {
    let b = signed_distance(event.radius, receiver.center + receiver.displacement, path.after);
    if (b <= 0.0) {
        return true;
    }
    if (event.kind == ENDPOINT) {
        return false;
    }
    let a = signed_distance(event.radius, receiver.center, path.before);
    let diffusion = own_diffusion + event.diffusion;
    if (diffusion == 0.0) {
        // The particle rests, or drifts out of or through the sphere.
        return a < 0.0 || passes(event, receiver, path);
    }
    let exponent = a * b / diffusion;
    if (exponent >= NEVER) {
        return false;
    }
    let word = philox(vec4(id, event.receiver, control.step, PURPOSE_RECEIVER), params.key).x;
    return open_unit(word) < exp(-exponent);
}
