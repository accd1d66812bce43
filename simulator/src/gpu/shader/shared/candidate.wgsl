struct Candidate {
    // Reactants, in the order of the reaction.
    at: vec2<u32>,
    ids: vec2<u32>,
    rule: u32,
    priority: u32,
}

struct Claim {
    // Best key of a round.
    priority: atomic<u32>,
    other: atomic<u32>,
    is_taken: atomic<u32>,
    // NOTHING if the particle is consumed.
    product: u32,
    sphere: vec4<f32>,
}

// The table begins with the first row of each ordered pair of species.
struct ReactionRow {
    reaction: u32,
    // The next row if the draw does not select this one, and if the pair is farther apart than `within`, or NOTHING.
    next: u32,
    next_shell: u32,
    // First reactant, or NOTHING if the species never react.
    first: u32,
    threshold: u32,
    // Bits 0 and 1: the reactant is consumed. Bit 2: the detector's cutoff exceeds `within`. Bit 3: products are placed
    // apart. Bit 7: a draw decides which of two equal reactants is the first. Only in first rows, bit 4: the species have
    // a reaction, even if its probability is 0; bits 5 and 6: the species dissociates.
    flags: u32,
    products: vec2<u32>,
    radii: vec2<f32>,
    within: f32,
    unbinding: f32,
    // First reactant's fraction of the distance to the meeting point, or the first species' of a separation. Then the
    // first product's of `unbinding`.
    first_fraction: f32,
    first_product_fraction: f32,
    speeds: vec2<f32>,
    thermal_speeds: vec2<f32>,
    product_speeds: vec2<f32>,
    product_thermal_speeds: vec2<f32>,
    // Largest words at which species dissociate; first rows only.
    dissociation_thresholds: vec2<u32>,
}

// Contact does not keep such species apart.
fn may_react(first_row: ReactionRow) -> bool {
    return (first_row.flags & 16u) != 0u;
}

fn claims_it(rule: ReactionRow, side: u32) -> bool {
    return (rule.flags & (1u << side)) != 0u;
}
