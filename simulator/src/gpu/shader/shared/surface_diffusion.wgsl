// See surface_diffusion.rs.

// 1 minus the cosine of the angle.
fn gap_of(concentration: f32, word: u32) -> f32 {
    let rest = unit_32(~word);
    let fraction = rest * one_minus_exp(2.0 * concentration);
    var gap = minus_ln_of_rest(fraction);
    if (fraction > 0.1) {
        gap = -ln(unit_32(word) + rest * exp(-2.0 * concentration));
    }
    return clamp(gap / concentration, 0.0, 2.0);
}

fn moved_on_surface(direction: vec3<f32>, concentration: f32, id: u32) -> vec3<f32> {
    if (concentration == 0.0) {
        return direction;
    }
    let words = philox(vec4(id, 0u, control.step, PURPOSE_SURFACE_DIFFUSION), params.key);
    let gap = gap_of(concentration, words.x);
    let n = normalize(direction);
    let size = abs(n);
    let is_first = size.x <= size.y && size.x <= size.z;
    let is_second = !is_first && size.y <= size.z;
    let axis = select(select(vec3(0.0, 0.0, 1.0), vec3(0.0, 1.0, 0.0), is_second), vec3(1.0, 0.0, 0.0), is_first);
    let u = normalize(cross(n, axis));
    let v = cross(n, u);
    let turn = sqrt(gap * (2.0 - gap)) * cos_sin(words.y);
    return normalize((1.0 - gap) * n + turn.x * u + turn.y * v);
}
