// Fewest bits of a folded axis: with eight cells before the fold repeats, two overlapping spheres never meet in
// different cells of one key.
const MIN_AXIS_BITS: u32 = 3u;
// More bits than an axis has at any depth: 19 at the first, and one more at each of the 31 others.
const MOST_BITS: u32 = 50u;

// Bits that tell the cells of this depth apart on each axis. A ring of cells has a multiple of four, so that a fold
// to fewer bits keeps neighbors apart across the seam too.
fn axis_bits(low: vec3<i32>, high: vec3<i32>, turns: vec3<f32>, depth: u32) -> vec3<u32> {
    let open = vec3(32u) - countLeadingZeros(vec3<u32>(high - low)) + vec3(depth);
#ifdef PERIODIC
    let around = vec3<i32>(min(turns * bitcast<f32>((127u + depth) << 23u), vec3(0x1p30)));
    let ring = vec3(32u) - countLeadingZeros(vec3<u32>(around - vec3(1)));
    return select(select(ring, vec3(0u), around < vec3(4)), open, turns == vec3(0.0));
#else
    return open;
#endif
}

// Bits of each axis, taken from the longest ones until `budget` is met, or the fewest that there may be.
fn hash_bits(wanted: vec3<u32>, budget: u32) -> vec3<u32> {
    var bits = min(wanted, vec3(MOST_BITS));
    for (var turn = 0u; turn < 3u * MOST_BITS; turn++) {
        if (bits.x + bits.y + bits.z <= max(budget, 3u * MIN_AXIS_BITS)) {
            break;
        }
        if (bits.x >= bits.y && bits.x >= bits.z) {
            bits.x = max(bits.x - 1u, MIN_AXIS_BITS);
        } else if (bits.y >= bits.z) {
            bits.y = max(bits.y - 1u, MIN_AXIS_BITS);
        } else {
            bits.z = max(bits.z - 1u, MIN_AXIS_BITS);
        }
    }
    return bits;
}
