#include wrapped_sphere

fn store_sorted(position: u32, index: u32) {
    sorted[position] = wrapped_sphere(spheres[index]);
#ifdef SPECIES
    sorted_species[position] = min(species[index], params.species - 1u);
#endif
}
