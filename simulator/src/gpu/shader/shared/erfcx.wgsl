const ROOT_PI: f32 = 1.7724538509055159;

// exp(x * x) * erfc(x) for x >= 0, with a relative error of 1e-6: 2 / (2 + x) times the exponential of a polynomial
// in (2 - x) / (2 + x), interpolated at the zeros of a Chebyshev polynomial.
fn erfcx(x: f32) -> f32 {
    let u = (2.0 - x) / (2.0 + x);
    let high = 0.0017940662500077753 + u * (-0.0022887652400513936 + u * (-0.0002279109663083645
        + u * (0.0005737663733462739 + u * (8.000738286995102e-6 + u * -8.728381067157898e-5))));
    let low = -0.671794091680776 + u * (0.6726431547745505 + u * (0.047343887612999444
        + u * (-0.046893640560102534 + u * (-0.009880019324116252 + u * (0.008808825370089868 + u * high)))));
    return 2.0 / (2.0 + x) * exp(low);
}
