// Hits on receivers and walls, as in path_hit.rs.

// A hit: a certain time, or both end heights in units of sqrt(2 D dt), from which a time is drawn.
struct Hit {
    is_hit: bool,
    is_drawn: bool,
    time: f32,
    heights: vec2<f32>,
}

fn hit_at(is_hit: bool, time: f32) -> Hit {
    return Hit(is_hit, false, time, vec2(0.0));
}

// Returns the hit of a whole path between two heights, of which the first is positive.
fn hit_between(heights: vec2<f32>, diffusion: f32) -> Hit {
    if (diffusion == 0.0) {
        return hit_at(true, min(heights.x / (heights.x - heights.y), 1.0));
    }
    return Hit(true, true, 0.0, heights / sqrt(2.0 * diffusion));
}

fn time_of(hit: Hit, receiver: u32, id: u32) -> f32 {
    if (!hit.is_drawn) {
        return hit.time;
    }
    let words = philox(vec4(id, receiver, control.step, PURPOSE_HIT_TIME), params.key);
    return first_passage(hit.heights, normals(words).x, open_unit(words.z));
}

// Returns the capture at a hit. Its time is drawn only if the species decays or dissociates.
fn capture_of(row: u32, hit: Hit, kind: SpeciesRow, id: u32) -> Capture {
    if (kind.decays_begin == kind.walls_begin && kind.dissociation_rate == 0.0) {
        return Capture(row, 0.0);
    }
    return Capture(row, time_of(hit, event_rows[row].receiver, id));
}
