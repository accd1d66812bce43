// Reflection at walls of diffusion with drift, as in wall.rs and bridge.rs.

fn reflected_at_wall(low: f32, high: f32, ends: vec2<f32>, spread: f32, word: u32) -> f32 {
    let before = ends.x;
    let end = ends.y;
    let is_low = (before - low) + (end - low) < (high - before) + (high - end);
    let a = select(high - before, before - low, is_low);
    let b = select(high - end, end - low, is_low);
    let square = spread * spread;
    if (2.0 * a * b >= NEVER * square) {
        return end;
    }
    let lowest = 0.5 * (a + b - sqrt((b - a) * (b - a) - 2.0 * square * ln(open_unit(word))));
    if (lowest >= 0.0) {
        return end;
    }
    return select(high - (b - lowest), low + (b - lowest), is_low);
}
