// The path of a particle in a step, and tests whether it hit a receiver, as in motion.rs and crossing.rs.
fn path_of(before: vec3<f32>, kind: SpeciesRow, id: u32) -> Path {
    let random = normals(philox(vec4(id, 0u, control.step, PURPOSE_MOVE), params.key));
    let end = before + (kind.length * random + kind.drift);
    return Path(before, end, confined(end, kind.radius));
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
