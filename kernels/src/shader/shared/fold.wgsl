// Fewest bits of a folded axis: with eight cells before the fold repeats, two overlapping spheres never meet in
// different cells of one key.
const FOLD_BITS: u32 = 3u;

// Bits that tell the cells of depth 0 apart on each axis.
fn axis_bits(low: vec3<i32>, high: vec3<i32>) -> vec3<u32> {
    return vec3(32u) - countLeadingZeros(vec3<u32>(high - low));
}

// Bits of each axis, taken from the longest ones until `budget`, which is at least nine, is met.
fn folded_bits(wanted: vec3<u32>, budget: u32) -> vec3<u32> {
    var bits = wanted;
    while (bits.x + bits.y + bits.z > budget) {
        if (bits.x >= bits.y && bits.x >= bits.z) {
            bits.x = max(bits.x - 1u, FOLD_BITS);
        } else if (bits.y >= bits.z) {
            bits.y = max(bits.y - 1u, FOLD_BITS);
        } else {
            bits.z = max(bits.z - 1u, FOLD_BITS);
        }
    }
    return bits;
}
