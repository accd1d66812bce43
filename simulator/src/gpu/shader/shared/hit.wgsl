// See path_hit.rs.

struct Hit {
    is_hit: bool,
    // The segment, in fractions of the step. Without a duration, the hit is at its beginning.
    begin: f32,
    fraction: f32,
    // Unit: sqrt(2 D dt) of the segment.
    heights: vec2<f32>,
}

fn hit_at(is_hit: bool, time: f32) -> Hit {
    return Hit(is_hit, time, 0.0, vec2(0.0));
}

// The first height is positive.
fn hit_between(heights: vec2<f32>, diffusion: f32) -> Hit {
    if (diffusion == 0.0) {
        return hit_at(true, min(heights.x / (heights.x - heights.y), 1.0));
    }
    return Hit(true, 0.0, 1.0, heights / sqrt(2.0 * diffusion));
}

fn time_of(hit: Hit, receiver: u32, id: u32) -> f32 {
    if (hit.fraction == 0.0) {
        return hit.begin;
    }
    let words = philox(vec4(id, receiver, control.step, PURPOSE_HIT_TIME), params.key);
    return hit.begin + hit.fraction * first_passage(hit.heights, normals(words).x, open_unit(words.z));
}
