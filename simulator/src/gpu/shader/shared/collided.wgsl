// The path written by collisions_land.
fn collided(path: Path, at: u32, kind: SpeciesRow) -> Path {
    if (params.collides == 0u || moved[at].w == 0.0) {
        return path;
    }
    let after = confined(moved[at].xyz, kind.radius);
    var velocity = path.velocity;
    if (params.has_velocity != 0u) {
        velocity = moved[velocity_at(at)].xyz;
    }
    let end = select(after, moved[at].xyz, params.axes == vec3(2u));
    let drift = select(path.drift, end - path.before, kind.diffusion == 0.0);
    return Path(path.before, end, after, velocity, path.free_end, drift);
}
