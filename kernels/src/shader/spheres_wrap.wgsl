// Moves each sphere to its image nearest to the origin, exactly: by long division of the numbers' bits, as no device
// rounds, flushes or overflows those.
#include layout
#include place

@group(0) @binding(0) var<uniform> call: Call;
@group(0) @binding(1) var<storage, read> grid: Grid;
@group(0) @binding(2) var<storage, read> given: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> wrapped: array<vec4<u32>>;

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
    var rest = x.digits % length.digits;
    var left = x.exponent - length.exponent;
    // Eight digits a turn, of 254 at most: 24 and these are all that 32 bits hold.
    for (var turn = 0u; turn < 32u; turn++) {
        if (left == 0u) {
            break;
        }
        let step = min(left, 8u);
        rest = (rest << step) % length.digits;
        left -= step;
    }
    if (2u * rest >= length.digits) {
        return bits_of(Number(length.digits - rest, length.exponent)) | (sign ^ SIGN);
    }
    return bits_of(Number(rest, length.exponent)) | sign;
}

@compute @workgroup_size(256)
fn spheres_wrap(@builtin(workgroup_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, place: Place) {
    let group = number_of_group(id, groups);
    let index = group * 256u + place.lane;
    if (index >= grid.spheres) {
        return;
    }
    let sphere = given[index];
    wrapped[index] = vec4(
        wrap(sphere.x, bitcast<u32>(call.period_x)),
        wrap(sphere.y, bitcast<u32>(call.period_y)),
        wrap(sphere.z, bitcast<u32>(call.period_z)),
        sphere.w,
    );
}
