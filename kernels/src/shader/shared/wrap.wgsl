// Computes the exact minimum image by long division of bits: integers are never rounded, flushed or infinite.
const SIGN: u32 = 0x80000000u;

// A non-negative float: digits * 2^(exponent - 150).
struct Number {
    digits: u32,
    exponent: u32,
}

fn number_of(bits: u32) -> Number {
    let exponent = bits >> 23u;
    let digits = bits & 0x7fffffu;
    return Number(select(digits, digits | 0x800000u, exponent != 0u), max(exponent, 1u));
}

fn bits_of(number: Number) -> u32 {
    if (number.digits == 0u) {
        return 0u;
    }
    let shift = min(countLeadingZeros(number.digits) - 8u, number.exponent - 1u);
    return (number.digits << shift) + ((number.exponent - shift - 1u) << 23u);
}

// At a tie, the remainder's sign is opposite to the coordinate's.
fn wrap(coordinate: u32, period: u32) -> u32 {
    let sign = coordinate & SIGN;
    let x = number_of(coordinate & ~SIGN);
    let length = number_of(period);
    if (period == 0u || x.exponent == 255u || x.exponent + 1u < length.exponent) {
        return coordinate;
    }
    if (x.exponent < length.exponent) {
        // Within one period, in units of half of the period's last place.
        if (x.digits < length.digits) {
            return coordinate;
        }
        return bits_of(Number(2u * length.digits - x.digits, x.exponent)) | (sign ^ SIGN);
    }
    // Numbers of 24 digits differ by less than a factor of two, so within two periods no division is needed.
    var rest = x.digits - select(0u, length.digits, x.digits >= length.digits);
    var left = x.exponent - length.exponent;
    // Each iteration divides eight of at most 254 binary digits, which with 24 digits of the remainder fit 32 bits. The
    // number of iterations varies, because compilers unroll fixed loops of up to 32.
    let iterations = max((left + 7u) / 8u, select(0u, 1u, rest >= length.digits));
    for (var iteration = 0u; iteration < iterations; iteration++) {
        let step = min(left, 8u);
        rest = (rest << step) % length.digits;
        left -= step;
    }
    if (2u * rest >= length.digits) {
        return bits_of(Number(length.digits - rest, length.exponent)) | (sign ^ SIGN);
    }
    return bits_of(Number(rest, length.exponent)) | sign;
}
