// The density table: for every cell how many smaller spheres overlap it, and in the highest bit whether a sphere of
// the cell's own depth does. Cells that share a counter look denser than they are; all who ask get the same answer.
// No count reaches that bit: a plan has fewer than 2^28.4 spheres, as it has room for an entry of each, and a sphere
// adds 1 for each of its cells. The hash would have to give seven cells of nearly every sphere, of at most 8 per depth,
// the same one of the 2^22 counters that there are for so many spheres.
const HAS_OWN: u32 = 0x80000000u;

// The first level has the lower half to itself, so that it is settled when the deeper ones are counted.
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
