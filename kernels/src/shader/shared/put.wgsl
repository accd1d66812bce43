#include image

// Brings a sphere to its place in the order of the cells.
fn put(position: u32, index: u32) {
    sorted[position] = image_of(spheres[index]);
#ifdef SPECIES
    sorted_species[position] = min(species[index], call.species - 1u);
#endif
}
