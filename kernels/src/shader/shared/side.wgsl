// The side of a sphere: the spheres of a call are on one side or two. Sides that do not meet are never compared, nor is a
// side with itself unless it meets itself. Two sets are two sides; else the species decide.

fn side_of(index: u32) -> u32 {
    var side = select(0u, 1u, call.split != 0u && index >= call.split);
#ifdef SPECIES
    if (call.split == 0u) {
        side = (reach[species[index]].x & SECOND_SIDE) / SECOND_SIDE;
    }
#endif
    return side;
}
