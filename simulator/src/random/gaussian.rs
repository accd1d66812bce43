//! Normally distributed numbers, by Box and Muller.
//!
//! All operations are correctly rounded and none is fused, so every processor and vector width gives the same bits.
//! Sine and cosine are Cephes polynomials; the logarithm is a series of artanh. The WGSL version may round differently.

use crate::random::philox::open_unit;

/// Returns independent standard normal numbers.
#[inline(always)]
pub fn normals(words: [u32; 4]) -> [f32; 3] {
    let [cosine, sine] = cos_sin(words[1]);
    let near = rayleigh(words[0]);
    let [third, _] = cos_sin(words[3]);
    [near * cosine, near * sine, rayleigh(words[2]) * third]
}

/// Returns √(−2 ln u) for the uniform number u of a word; at most 5.77.
#[inline(always)]
fn rayleigh(word: u32) -> f32 {
    (-2.0 * ln(open_unit(word))).sqrt()
}

const ROOT_HALF: u32 = 0x3f35_04f3;

/// Natural logarithm of a positive normal number, to three parts in 10⁷.
#[inline(always)]
pub(crate) fn ln(value: f32) -> f32 {
    let shifted = value.to_bits().wrapping_sub(ROOT_HALF);
    let exponent = ((shifted as i32) >> 23) as f32;
    let mantissa = f32::from_bits((shifted & 0x007f_ffff).wrapping_add(ROOT_HALF));
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let t = s * s;
    let series = 2.0 + t * (0.666_666_7 + t * (0.4 + t * (0.285_714_3 + t * 0.222_222_2)));
    exponent * std::f32::consts::LN_2 + s * series
}

/// Cosine and sine of the angle `word`/2³² of a full circle.
#[inline(always)]
pub fn cos_sin(word: u32) -> [f32; 2] {
    let quarter = word.wrapping_add(0x2000_0000) >> 30;
    let rest = (word.wrapping_sub(quarter << 30) as i32) >> 8;
    let a = rest as f32 * (std::f32::consts::TAU / 16_777_216.0);
    let b = a * a;
    let sine = a + a * b * (-0.166_666_55 + b * (0.008_332_161 + b * -0.000_195_152_96));
    let cosine = 1.0 - 0.5 * b + b * b * (0.041_666_646 + b * (-0.001_388_731_6 + b * 0.000_024_433_157));
    // A quarter circle swaps them; signs go + − − + and + + − −.
    let swap = 0u32.wrapping_sub(quarter & 1);
    let (c, s) = (cosine.to_bits(), sine.to_bits());
    let [c, s] = [(s & swap) | (c & !swap), (c & swap) | (s & !swap)];
    let cosine_sign = ((quarter + 1) & 2) << 30;
    let sine_sign = (quarter & 2) << 30;
    [f32::from_bits(c ^ cosine_sign), f32::from_bits(s ^ sine_sign)]
}

/// Returns a uniformly random unit vector.
#[inline]
pub fn direction(first: u32, second: u32) -> [f32; 3] {
    let z = 2.0 * open_unit(first) - 1.0;
    let across = (1.0 - z * z).max(0.0).sqrt();
    let [cosine, sine] = cos_sin(second);
    [across * cosine, across * sine, z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::philox::philox;

    #[test]
    fn logarithm_and_angle_are_accurate() {
        for k in 0..200_000_u32 {
            let word = k.wrapping_mul(0x9e37_79b9).wrapping_add(k);
            let u = open_unit(word);
            let exact = libm::log(f64::from(u));
            assert!((f64::from(ln(u)) - exact).abs() <= 3e-7 * exact.abs(), "ln {u}");
            let [c, s] = cos_sin(word);
            let angle = f64::from(word) / 4_294_967_296.0 * std::f64::consts::TAU;
            assert!((f64::from(c) - angle.cos()).abs() < 5e-7, "cos {angle} is {c}");
            assert!((f64::from(s) - angle.sin()).abs() < 5e-7, "sin {angle} is {s}");
        }
    }

    #[test]
    fn moments_match_the_normal_distribution() {
        let n = 200_000_u32;
        let mut sums = [0.0_f64; 4];
        let mut mixed = 0.0;
        for k in 0..n {
            let z = normals(philox([k, 0, 0, 0], [1, 2])).map(f64::from);
            for z in z {
                sums.iter_mut().zip(1..).for_each(|(sum, power)| *sum += z.powi(power));
            }
            mixed += z[0] * z[1] + z[1] * z[2] + z[0] * z[2];
        }
        let count = 3.0 * f64::from(n);
        for ((sum, moment), variance) in
            sums.into_iter().zip([0.0, 1.0, 0.0, 3.0]).zip([1.0, 2.0, 15.0, 96.0])
        {
            let error = (sum / count - moment) / (variance / count).sqrt();
            assert!(error.abs() < 5.0, "{error} standard errors");
        }
        assert!((mixed / count.sqrt()).abs() < 5.0);
    }
}
