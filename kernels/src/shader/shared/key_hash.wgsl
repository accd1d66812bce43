// With eight cells per axis before keys repeat, overlapping spheres are never in different cells of one key.
const MIN_AXIS_BITS: u32 = 3u;
// An axis has 19 bits at depth 0, and one more at each of the 31 further depths.
const MAX_BITS: u32 = 50u;

// Returns the bits that distinguish the cells of this depth. A ring has a multiple of four cells, so fewer bits also
// keep neighbors distinct across the periodic boundary.
fn axis_bits(low: vec3<i32>, high: vec3<i32>, ring_cells: vec3<f32>, depth: u32) -> vec3<u32> {
    let open = vec3(32u) - countLeadingZeros(vec3<u32>(high - low)) + vec3(depth);
#ifdef PERIODIC
    let around = vec3<i32>(min(ring_cells * bitcast<f32>((127u + depth) << 23u), vec3(0x1p30)));
    let ring = vec3(32u) - countLeadingZeros(vec3<u32>(around - vec3(1)));
    return select(select(ring, vec3(0u), around < vec3(4)), open, ring_cells == vec3(0.0));
#else
    return open;
#endif
}

// Reduces the longest axes to `budget`, or to the fewest possible bits.
fn hash_bits(wanted: vec3<u32>, budget: u32) -> vec3<u32> {
    var bits = min(wanted, vec3(MAX_BITS));
    for (var iteration = 0u; iteration < 3u * MAX_BITS; iteration++) {
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
