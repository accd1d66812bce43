// Sides have equal numbers of levels, side after side. Any sphere may use the first level of its side, which has depth
// 0.

// Depths that occur, and the depth of each level, DEPTHS without spheres.
var<workgroup> depths: atomic<u32>;
var<workgroup> level_depths: array<atomic<u32>, DEPTHS>;
var<workgroup> populations: array<atomic<u32>, LEVELS>;
var<workgroup> on_side: array<atomic<u32>, MAX_SIDES>;

fn meets(a: u32, b: u32) -> bool {
    let partners = select(params.partners_low, params.partners_high, a >= 4u) >> ((a % 4u) * 8u);
    return ((partners >> b) & 1u) != 0u;
}

fn depth_of(level: u32) -> u32 {
    return atomicLoad(&level_depths[level % params.levels_per_side]);
}

fn is_first_of_side(level: u32) -> bool {
    return level % params.levels_per_side == 0u;
}

fn finest_depth(radius: f32) -> u32 {
    if (is_single != 0u) {
        return 0u;
    }
    let mantissa = select(0, 1, (bitcast<u32>(radius) & 0x7fffffu) > (bitcast<u32>(level_radius) & 0x7fffffu));
    return u32(clamp(exponent_of(level_radius) - exponent_of(radius) - mantissa, 0, i32(DEPTHS) - 1));
}

// Neighboring depths share a level if more depths than levels occur.
fn level_of_depth(depth: u32) -> u32 {
    let number = countOneBits(atomicLoad(&depths) & ((1u << depth) - 1u));
    let total = max(countOneBits(atomicLoad(&depths)), params.levels_per_side);
    return min(number * params.levels_per_side / total, params.levels_per_side - 1u);
}

fn spheres_on_side(level: u32) -> u32 {
    let side = level / params.levels_per_side;
    return select(0u, atomicLoad(&on_side[min(side, MAX_SIDES - 1u)]), side < params.sides);
}

fn is_used(level: u32) -> bool {
    return level == 0u || (is_first_of_side(level) && spheres_on_side(level) != 0u);
}

fn spheres_at(level: u32) -> u32 {
    if (has_overfull_cells) {
        return atomicLoad(&populations[level]);
    }
    return select(0u, spheres_on_side(level), is_first_of_side(level));
}

// Spheres at the finer level find the others. At one level of two sides, the side with fewer spheres there does.
fn set_searched_levels(level: u32, used: u32) {
    let side = level / params.levels_per_side;
    let own = 1u << (level % params.levels_per_side);
    var searched_levels = 0u;
    for (var other = 0u; other < params.sides; other++) {
        let same = other * params.levels_per_side + level % params.levels_per_side;
        let fewer = spheres_at(level) < spheres_at(same) || (spheres_at(level) == spheres_at(same) && side < other);
        let searched = (own - 1u) | select(0u, own, other != side && fewer);
        searched_levels |= select(0u, (searched << (other * params.levels_per_side)) & used, meets(side, other));
    }
    cell_list.level[level].searched_levels = searched_levels;
    cell_list.level[level].searches_itself = select(0u, 1u, meets(side, side));
}
