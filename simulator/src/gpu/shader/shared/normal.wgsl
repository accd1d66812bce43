// The operations of gaussian.rs, in order.
fn ln(value: f32) -> f32 {
    let root_half = 0x3f3504f3u;
    let shifted = bitcast<u32>(value) - root_half;
    let exponent = f32(bitcast<i32>(shifted) >> 23u);
    let mantissa = bitcast<f32>((shifted & 0x007fffffu) + root_half);
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let t = s * s;
    let series = 2.0 + t * (0.6666667 + t * (0.4 + t * (0.2857143 + t * 0.2222222)));
    return exponent * 0.6931471805599453 + s * series;
}

fn rayleigh(word: u32) -> f32 {
    return sqrt(-2.0 * ln(open_unit(word)));
}

// The angle is a 32-bit fraction of a turn.
fn cos_sin(word: u32) -> vec2<f32> {
    let quarter = (word + 0x20000000u) >> 30u;
    let rest = bitcast<i32>(word - (quarter << 30u)) >> 8u;
    let a = f32(rest) * (6.283185307179586 / 16777216.0);
    let b = a * a;
    let sine = a + a * b * (-0.16666655 + b * (0.008332161 + b * -0.00019515296));
    let cosine = 1.0 - 0.5 * b + b * b * (0.041666646 + b * (-0.0013887316 + b * 0.000024433157));
    let swapped = select(vec2(cosine, sine), vec2(sine, cosine), (quarter & 1u) != 0u);
    let signs = vec2(((quarter + 1u) & 2u) << 30u, (quarter & 2u) << 30u);
    return bitcast<vec2<f32>>(bitcast<vec2<u32>>(swapped) ^ signs);
}

fn normals(words: vec4<u32>) -> vec3<f32> {
    return vec3(rayleigh(words.x) * cos_sin(words.y), rayleigh(words.z) * cos_sin(words.w).x);
}

fn direction(first: u32, second: u32) -> vec3<f32> {
    let z = 2.0 * open_unit(first) - 1.0;
    return vec3(sqrt(max(1.0 - z * z, 0.0)) * cos_sin(second), z);
}
