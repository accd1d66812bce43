// Two sets are two sides; otherwise the species decide.

#ifdef SPECIES
const MAX_SIDES: u32 = 8u;
#else
const MAX_SIDES: u32 = 2u;
#endif

fn side_of(index: u32) -> u32 {
    var side = select(0u, 1u, params.second_set_start != 0u && index >= params.second_set_start);
#ifdef SPECIES
    if (params.second_set_start == 0u) {
        side = species_params[species[index]].x >> SIDE_SHIFT;
    }
#endif
    return side;
}
