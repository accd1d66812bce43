// The image of a coordinate nearest to the origin, exactly: by long division of the numbers' bits, as no device rounds,
// flushes or overflows those.
const SIGN: u32 = 0x80000000u;

// A float that is not negative: digits * 2^(exponent - 150).
struct Number {
    digits: u32,
    exponent: u32,
}

fn number_of(bits: u32) -> Number {
    let exponent = bits >> 23u;
    let digits = bits & 0x7fffffu;
    return Number(select(digits, digits | 0x800000u, exponent != 0u), max(exponent, 1u));
}

// Of at most 24 digits.
fn bits_of(number: Number) -> u32 {
    if (number.digits == 0u) {
        return 0u;
    }
    let shift = min(countLeadingZeros(number.digits) - 8u, number.exponent - 1u);
    return (number.digits << shift) + ((number.exponent - shift - 1u) << 23u);
}

// The remainder of least magnitude, as bits; halves go to the side other than the coordinate's.
fn wrap(coordinate: u32, period: u32) -> u32 {
    let sign = coordinate & SIGN;
    let x = number_of(coordinate & ~SIGN);
    let length = number_of(period);
    if (period == 0u || x.exponent == 255u || x.exponent + 1u < length.exponent) {
        return coordinate;
    }
    if (x.exponent < length.exponent) {
        // Within a length; in units of half its last place.
        if (x.digits < length.digits) {
            return coordinate;
        }
        return bits_of(Number(2u * length.digits - x.digits, x.exponent)) | (sign ^ SIGN);
    }
    // Numbers of 24 digits are less than twice as large as one another, so that no coordinate within two lengths is divided.
    var rest = x.digits - select(0u, length.digits, x.digits >= length.digits);
    var left = x.exponent - length.exponent;
    // Eight digits a turn, of 254 at most: 24 and these are all that 32 bits hold. As many turns as it takes, since
    // compilers write out a loop of up to 32 of them.
    let turns = max((left + 7u) / 8u, select(0u, 1u, rest >= length.digits));
    for (var turn = 0u; turn < turns; turn++) {
        let step = min(left, 8u);
        rest = (rest << step) % length.digits;
        left -= step;
    }
    if (2u * rest >= length.digits) {
        return bits_of(Number(length.digits - rest, length.exponent)) | (sign ^ SIGN);
    }
    return bits_of(Number(rest, length.exponent)) | sign;
}
