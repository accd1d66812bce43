// Each counter has the number of smaller spheres in a cell; its highest bit marks spheres of the cell's own depth. No
// count reaches this bit. A plan has fewer than 2^28.4 spheres, because it has space for an entry of each, and a sphere
// adds at most eight per depth. Nearly every sphere would need seven cells that hash to the same one of 2^22 counters.
const HAS_OWN: u32 = 0x80000000u;

// Only the first level uses the lower half, so its counts are final while deeper levels are counted.
fn occupancy_slot(depth: u32, cell: vec3<i32>) -> u32 {
    let c = vec3<u32>(in_ring(cell, depth)) * vec3(0x9e3779b1u, 0x85ebca6bu, 0xc2b2ae35u);
    var hash = (c.x ^ (c.y >> 7u) ^ (c.y << 25u) ^ (c.z >> 15u) ^ (c.z << 17u)) + depth * 0x27d4eb2fu;
    hash = (hash ^ (hash >> 15u)) * 0x2c1b3c6du;
    hash ^= hash >> 13u;
    return (hash & (params.occupancy_slots - 1u)) + select(0u, params.occupancy_slots, depth != 0u);
}

fn is_overfull(count: u32) -> bool {
    return (count & ~HAS_OWN) > params.tau;
}
