// See wall.rs and bridge.rs.

// Returns the lowest point of a path, or 0 or more if it is not below 0.
fn lowest_point(ends: vec2<f32>, spread: f32, word: u32) -> f32 {
    let square = spread * spread;
    if (2.0 * ends.x * ends.y >= NEVER * square) {
        return 0.0;
    }
    let apart = ends.y - ends.x;
    return 0.5 * (ends.x + ends.y - sqrt(apart * apart - 2.0 * square * ln(open_unit(word))));
}

fn reflected_at_wall(low: f32, high: f32, ends: vec2<f32>, spread: f32, word: u32) -> f32 {
    let before = ends.x;
    let end = ends.y;
    let is_low = (before - low) + (end - low) < (high - before) + (high - end);
    let a = select(high - before, before - low, is_low);
    let b = select(high - end, end - low, is_low);
    let lowest = lowest_point(vec2(a, b), spread, word);
    if (lowest >= 0.0) {
        return end;
    }
    return select(high - (b - lowest), low + (b - lowest), is_low);
}
