var<workgroup> tile: array<vec4<f32>, 256>;
var<workgroup> tile_objects: array<u32, 256>;
#ifdef SPECIES
var<workgroup> tile_species: array<u32, 256>;
#endif

struct QuerySphere {
    sphere: vec4<f32>,
    object: u32,
    species: u32,
}

// Returns a bit for each of 32 spheres that pairs with the query.
fn tile_hits(query: QuerySphere, first: u32) -> u32 {
    var hits = 0u;
#ifdef SPECIES
    for (var k = 0u; k < 32u; k++) {
        let hit = is_pair(query.sphere, tile[first + k], query.species, tile_species[first + k]);
        hits |= select(0u, 1u << k, hit);
    }
#else
    if (grid.ordinary != 0u) {
        for (var k = 0u; k < 32u; k++) {
            hits |= select(0u, 1u << k, is_within_ordinary(query.sphere, tile[first + k]));
        }
    } else {
        for (var k = 0u; k < 32u; k++) {
            hits |= select(0u, 1u << k, is_pair(query.sphere, tile[first + k]));
        }
    }
#endif
    return hits;
}

// Returns a bit for each of 32 spheres in `begin..finish`.
fn tile_window(first: u32, begin: u32, finish: u32) -> u32 {
    let low = clamp(begin, first, first + 32u) - first;
    let high = clamp(finish, first, first + 32u) - first;
    return bits_below(high) & ~bits_below(low);
}

fn bits_below(count: u32) -> u32 {
    return select((1u << (count & 31u)) - 1u, 0xffffffffu, count >= 32u);
}
