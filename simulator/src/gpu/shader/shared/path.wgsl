// See propagate.rs.
#include chemotaxis
#include flow_field

struct FreePath {
    end: vec3<f32>,
    drift: vec3<f32>,
}

fn free_path_of(before: vec3<f32>, velocity: vec3<f32>, kind: SpeciesRow, id: u32) -> FreePath {
    let random = flattened(normals(philox(vec4(id, 0u, control.step, PURPOSE_MOVE), params.key)));
    let spread = kind.length * random;
    let drift = kind.drift + velocity * params.time_step;
    let carried = drift + carried_by_field(before, before + (spread + drift), kind.radius);
    return FreePath(before + (spread + carried), carried);
}

fn path_of(before: vec3<f32>, velocity: vec3<f32>, kind: SpeciesRow, id: u32) -> Path {
    let free = free_path_of(before, velocity, kind, id);
    let free_end = free.end;
    if (params.vessel_axis == NO_VESSEL) {
        let end = reflected_at_walls(before, free_end, kind, id);
        let own = select(velocity, -velocity, reversed_axes(end, kind.radius));
        return Path(before, end, confined(end, kind.radius), own, free_end, free.drift);
    }
    let reflected = reflect_in_vessel(before, free_end, params.vessel_radius - kind.radius, velocity);
    let flow = flow_between(before, reflected.end) * along_vessel();
    let carried = reflected_at_walls(before, reflected.end + flow, kind, id);
    let own = select(reflected.velocity, -reflected.velocity, reversed_axes(carried, kind.radius));
    return Path(before, carried, confined_axes(carried, kind.radius), own, free_end + flow, free.drift + flow);
}

fn velocity_of(at: u32, kind: SpeciesRow, id: u32) -> vec3<f32> {
    if (params.has_velocity == 0u) {
        return vec3(0.0);
    }
    let velocity = spheres[velocity_at(at)].xyz;
    if (kind.tumbles != 0u) {
        let words = philox(vec4(id, 0u, control.step, PURPOSE_TUMBLE), params.key);
        if (is_tumbling(kind, spheres[at].xyz, velocity, words.x)) {
            return kind.speed * direction_within(direction(words.y, words.z));
        }
    }
    return velocity;
}

fn reflected_at_walls(before: vec3<f32>, end: vec3<f32>, kind: SpeciesRow, id: u32) -> vec3<f32> {
    if (kind.drifts_at_wall == 0u) {
        return end;
    }
    let words = philox(vec4(id, 0u, control.step, PURPOSE_WALL), params.key);
    var reflected = end;
    for (var k = 0u; k < 3u; k++) {
        if ((kind.drifts_at_wall & (1u << k)) != 0u) {
            let low = params.low[k] + kind.radius;
            let high = params.high[k] - kind.radius;
            let at_wall = reflected_at_wall(low, high, vec2(before[k], end[k]), kind.length, words[k]);
            reflected = with_component(reflected, k, at_wall);
        }
    }
    return reflected;
}
