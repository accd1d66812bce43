// See path_hit.rs.

// Above it the probability is below the smallest random number.
const NEVER: f32 = 17.0;

// 1 - exp(-x) for x >= 0, to a few units in the last place.
fn one_minus_exp(x: f32) -> f32 {
    if (x < 0.125) {
        return x * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0)))));
    }
    return 1.0 - exp(-x);
}

// Between heights a and b > 0.
fn hit_probability(radius: f32, a: f32, b: f32, diffusion: f32) -> f32 {
    let exponent = a * b / diffusion;
    if (exponent >= NEVER) {
        return 0.0;
    }
    let image = radius * (a + b + radius) / diffusion;
    return exp(-exponent) * one_minus_exp(image) / one_minus_exp(exponent + image);
}

// Takes heights in sqrt(2 D dt); returns a time in steps.
fn first_passage(heights: vec2<f32>, normal: f32, uniform: f32) -> f32 {
    let a = heights.x;
    let b = abs(heights.y);
    if (a <= 0.0) {
        return 0.0;
    }
    let square = normal * normal;
    let sum = 2.0 * a * b + square + sqrt(square * (square + 4.0 * a * b));
    // The smaller root is 2 a a / sum, and the larger one sum / (2 b b).
    if (uniform * (a * sum + 2.0 * b * a * a) <= a * sum) {
        return 2.0 * a * a / (sum + 2.0 * a * a);
    }
    return sum / (sum + 2.0 * b * b);
}
