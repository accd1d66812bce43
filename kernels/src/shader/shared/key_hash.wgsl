// With eight cells before keys repeat, overlapping spheres are never in different cells of one key.
const MIN_AXIS_BITS: u32 = 3u;
// Above the bits of an axis: 18 at depth 0, and one more at each of the 31 further depths.
const MAX_BITS: u32 = 50u;

// Rings have a multiple of four cells, so fewer bits also keep neighbors across the boundary distinct.
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
