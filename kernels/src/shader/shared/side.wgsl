// Species decide the sides. Sides of a second set follow.

#ifdef SPECIES
const MAX_SIDES: u32 = 8u;
#else
const MAX_SIDES: u32 = 2u;
#endif

fn side_of(index: u32) -> u32 {
    let of_set = select(params.sides, params.sides / 2u, params.second_set_start != 0u);
    var side = select(0u, of_set, params.second_set_start != 0u && index >= params.second_set_start);
#ifdef SPECIES
    // Sets with one side each ignore the species.
    side += min(species_params[species[index]].x >> SIDE_SHIFT, of_set - 1u);
#endif
    return side;
}
