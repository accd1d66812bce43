// The way of a particle in a step, and whether it met a receiver on it, as motion.rs and crossing.rs have it.
fn path_of(before: vec3<f32>, kind: Kind, id: u32) -> Path {
    let random = normals(philox(vec4(id, 0u, control.step, PURPOSE_MOVE), params.key));
    let end = before + (kind.length * random + kind.drift);
    return Path(before, end, placed(end, kind.radius));
}

// Whether a particle that drifted came through the sphere on its way, in the frame of that.
fn passes(fate: Fate, body: Body, path: Path) -> bool {
    let start = nearest(path.before - body.center);
    let way = path.end - path.before - body.way;
    let across = cross(start, way);
    return dot(start, way) < 0.0 && dot(start + way, way) > 0.0
        && dot(across, across) <= fate.radius * fate.radius * dot(way, way);
}

fn meets(fate: Fate, body: Body, path: Path, own_diffusion: f32, id: u32) -> bool {
    let b = height(fate.radius, body.center + body.way, path.after);
    if (b <= 0.0) {
        return true;
    }
    if (fate.kind == ENDPOINT) {
        return false;
    }
    let a = height(fate.radius, body.center, path.before);
    let diffusion = own_diffusion + fate.diffusion;
    if (diffusion == 0.0) {
        // At rest, or carried out or through by a drift.
        return a < 0.0 || passes(fate, body, path);
    }
    let exponent = a * b / diffusion;
    if (exponent >= NEVER) {
        return false;
    }
    let word = philox(vec4(id, fate.receiver, control.step, PURPOSE_RECEIVER), params.key).x;
    return open_unit(word) < exp(-exponent);
}
