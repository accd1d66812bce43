// The side of a sphere: the spheres of a call are on one side or two. Sides that do not meet are never compared, nor is a
// side with itself unless it meets itself. Two sets are two sides; else the species decide.

fn side_of(index: u32) -> u32 {
    var side = select(0u, 1u, params.second_set_start != 0u && index >= params.second_set_start);
#ifdef SPECIES
    if (params.second_set_start == 0u) {
        side = (species_params[species[index]].x & SECOND_SIDE) / SECOND_SIDE;
    }
#endif
    return side;
}
